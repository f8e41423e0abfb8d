using System;
using System.Collections.Generic;
using Mujoco;
using UnityEngine;
using static System.FormattableString;

namespace Trunkline {

/// <summary>Makes the imported arm the calibrated one: its springs, its rest at the start, its time step.
///
/// To every model that MuJoCo's scene compiles it gives what the importer cannot read: springs and dampers that are no
/// straight lines. Where the arm is compiled for the first time it is led to rest under the scene's gravity and the
/// controls that are set, 0 for none; later its activations, which the plug-in forgets, are restored. It sets the time
/// step by the display's rate, and says where the device does not keep up. All it knows of the arm is in manifest.json.
/// `trunkline/unity/start.py` in the repository does the same, and is tested against the arm's statics.</summary>
[AddComponentMenu("Trunkline/Twin")]
[DisallowMultipleComponent]
public class Twin : MonoBehaviour {

  [Tooltip("Runtime/manifest.json of this package.")]
  public TextAsset ManifestFile;

  [Tooltip("Hz, at which frames are shown. 0: what the screen says; a headset's own rate is known to its plug-in.")]
  public float DisplayRate;

  [Tooltip("Set Project Settings > Physics > Gravity to that of the arm's calibration, straight down.")]
  public bool SetGravity;

#pragma warning disable 649  // JsonUtility fills the fields
  // The part of the manifest that is read. JsonUtility goes by these names and skips all others.
  [Serializable]
  private class Manifest {
    public Model model;
  }

  [Serializable]
  private class Model {
    public double longest_step;
    public float[] gravity_unity;
    public Names names;
    public Actuator[] actuators;
    public Branch[] branches;
    public JointLaw[] springs;
    public JointLaw[] dampers;
    public TendonLaw[] diagonals;
  }

  [Serializable]
  private class Names {
    public string[] joints;
    public string[] tendons;
  }

  [Serializable]
  private class Actuator {
    public string name;
    public double rest_length;
  }

  [Serializable]
  private class Branch {
    public string joint;
    public string branch;
    public string tie;
  }

  [Serializable]
  private class JointLaw {
    public string joint;
    public double[] coefficients;
  }

  [Serializable]
  private class TendonLaw {
    public string tendon;
    public double[] coefficients;
  }
#pragma warning restore 649

  private const int _higherOrders = 2;  // mjNPOLY: b and c
  private const double _still = 1e-5;  // rad, by which no joint has turned between two peaks of an arm at rest
  private const int _peaks = 3;  // so many of them, one after the other
  private const int _longestRise = 200;  // steps that are waited for a peak: an arm that rests already has none
  private const int _mostSteps = 5000;
  private const double _held = 1e6;  // N m s/rad, with which nothing moves
  private const int _framesCaughtUp = 2;  // of the display, that a late one may simulate
  private const float _ahead = 1, _letter = 0.004f;  // m, of the warning before the camera

  private Model _arm;
  private Dictionary<string, MjHingeJoint> _joints;
  private Dictionary<string, MjBaseTendon> _tendons;
  private MjActuator[] _actuators;
  private bool _fits;  // whether the scene has all that the manifest names
  private double[] _activations;  // m, of the actuators, after the last step; none before the arm has been settled
  private float[] _pulls;  // m, the last finite controls
  private string _told;  // what the console was told last, and is not told again
  private readonly KeepUp _keepUp = new KeepUp();
  private double _simulated;  // s, since the last frame
  private TextMesh _warning;

  /// <summary>Whether commands may be sent: the scene has been compiled, and has all of the arm.</summary>
  public bool IsReady => _actuators != null && _fits;

  /// <summary>Draw the tendons in: path lengths in m, as the network gives them, in the order of the manifest's
  /// actuators. Where one is no finite number, all pulls stay as they are; that, and what else is wrong, is one line in
  /// the console.</summary>
  public void Send(double[] commands) {
    if (!IsReady) {
      Complain("found no arm that is ready, expected commands after the scene's start");
      return;
    }
    if (commands == null || commands.Length != _actuators.Length) {
      Complain($"found {(commands == null ? 0 : commands.Length)} commands, expected {_actuators.Length}");
      return;
    }
    foreach (double command in commands) {
      if (!IsControl(command)) {
        Complain(Invariant($"found the command {command}, expected finite numbers; the pulls stay as they are"));
        return;
      }
    }
    _told = null;
    for (int i = 0; i < commands.Length; i++) {
      _actuators[i].Control = (float)(_arm.actuators[i].rest_length - commands[i]);
    }
  }

  /// <summary>Show frames at another rate, Hz, from now on.</summary>
  public void SetDisplayRate(float rate) {
    DisplayRate = rate;
    SetStep();
  }

  protected unsafe void OnEnable() {
    _arm = ReadArm();
    if (_arm == null) {
      Complain("found no Manifest File that says all of an arm, expected Runtime/manifest.json of this package");
      return;
    }
    if (!HasItsLibrary()) {
      _arm = null;
      return;
    }
    SetStep();
    if (SetGravity) {
      Physics.gravity = new Vector3(_arm.gravity_unity[0], _arm.gravity_unity[1], _arm.gravity_unity[2]);
    }
    // postInitEvent is raised for the first model and each later one: MjScene compiles anew whenever a component of
    // MuJoCo's comes or goes.
    var scene = MjScene.Instance;
    scene.postInitEvent += OnCompiled;
    scene.preUpdateEvent += BeforeStep;
    scene.postUpdateEvent += AfterStep;
    if (scene.Model != null) {  // what is below this object may not be in that model, or under other numbers
      scene.SceneRecreationAtLateUpdateRequested = true;
    }
  }

  protected void OnDisable() {
    if (_arm != null && MjScene.InstanceExists) {
      MjScene.Instance.postInitEvent -= OnCompiled;
      MjScene.Instance.preUpdateEvent -= BeforeStep;
      MjScene.Instance.postUpdateEvent -= AfterStep;
    }
    Warn(null);
  }

  protected void OnApplicationPause(bool paused) {
    _keepUp.Restart();
  }

  // Once a frame: how much of its time was simulated.
  protected void Update() {
    bool runs = _arm != null && MjScene.InstanceExists && MjScene.Instance.isActiveAndEnabled;
    if (!runs || Time.timeScale == 0) {
      _keepUp.Restart();
      return;
    }
    if (_keepUp.Add(Time.unscaledDeltaTime * Time.timeScale, _simulated)) {
      var told = _keepUp.Behind ? KeepUp.Warning(_keepUp.Share, Time.fixedDeltaTime) : null;
      if (told != null && _warning == null) {
        Debug.LogWarning(told, this);
      }
      Warn(told);
    }
    _simulated = 0;
  }

  // The manifest's block, none where it lacks something.
  private Model ReadArm() {
    try {
      var arm = ManifestFile == null ? null : JsonUtility.FromJson<Manifest>(ManifestFile.text).model;
      bool whole = arm != null && arm.longest_step > 0 && arm.gravity_unity?.Length == 3 && arm.names?.joints != null
          && arm.names.tendons != null && arm.actuators?.Length > 0 && arm.branches != null && arm.springs != null
          && arm.dampers != null && arm.diagonals != null;
      return whole ? arm : null;
    } catch (ArgumentException) {  // no JSON
      return null;
    }
  }

  // The plug-in's structures are those of one version of libmujoco. Of another they are misread, or crash.
  private bool HasItsLibrary() {
    string expected = Version(MujocoLib.mjVERSION_HEADER);
    try {
      int found = MujocoLib.mj_version();
      if (found == MujocoLib.mjVERSION_HEADER) {
        return true;
      }
      Complain($"found libmujoco {Version(found)}, expected {expected}, which org.mujoco is made for");
    } catch (DllNotFoundException) {
      Complain($"found no libmujoco, expected that of MuJoCo {expected}, which org.mujoco is made for");
    }
    return false;
  }

  private static string Version(int number) => $"{number / 1000000}.{number / 1000 % 1000}.{number % 1000}";

  // A step that is no whole part of a frame would show one frame after more steps than the next. A late frame is not
  // made up for beyond the next: what is slow already would have still more to do.
  private unsafe void SetStep() {
    if (_arm == null) {
      return;
    }
    double rate = Pace.Known(DisplayRate > 0 ? DisplayRate : Screen.currentResolution.refreshRateRatio.value);
    Time.fixedDeltaTime = (float)Pace.Step(rate, _arm.longest_step);
    Time.maximumDeltaTime = (float)(_framesCaughtUp / rate);
    if (MjScene.InstanceExists && MjScene.Instance.Model != null) {
      MjScene.Instance.Model->opt.timestep = Time.fixedDeltaTime;
    }
  }

  private unsafe void OnCompiled(object sender, MjStepArgs args) {
    if (args.model == null || args.data == null) {  // CreateScene(skipCompile: true), which writes an MJCF alone
      return;
    }
    _fits = FindAll();
    if (!_fits) {
      foreach (var joint in GetComponentsInChildren<MjHingeJoint>()) {
        args.model->dof_damping[joint.DofAddress] = _held;
      }
      return;
    }
    RestoreLaws(args.model);
    HoldWhatIsBad();
    for (int i = 0; i < _actuators.Length; i++) {
      args.data->ctrl[_actuators[i].MujocoId] = _actuators[i].Control;
    }
    if (_activations == null) {
      _activations = Array.ConvertAll(_actuators, actuator => (double)actuator.Control);
      Settle(args.model, args.data);
    }
    for (int i = 0; i < _actuators.Length; i++) {
      SetActivation(args.model, args.data, i, _activations[i]);
    }
    MujocoLib.mj_forward(args.model, args.data);
    MjScene.Instance.SyncUnityToMjState();  // so that the first frame shows the arm at rest
  }

  private unsafe void BeforeStep(object sender, MjStepArgs args) {
    if (!_fits) {
      return;
    }
    HoldWhatIsBad();
    foreach (var actuator in _actuators) {
      if (!IsControl(args.data->ctrl[actuator.MujocoId])) {
        args.data->ctrl[actuator.MujocoId] = actuator.Control;
      }
    }
  }

  private unsafe void AfterStep(object sender, MjStepArgs args) {
    _simulated += args.model->opt.timestep;
    if (!_fits) {
      return;
    }
    for (int i = 0; i < _actuators.Length; i++) {
      int address = args.model->actuator_actadr[_actuators[i].MujocoId];
      _activations[i] = address < 0 ? 0 : args.data->act[address];
    }
  }

  // What the manifest names, below this object; the importer names each object after its MJCF element. What is missing
  // is told in one line, and the arm stands still.
  private bool FindAll() {
    _joints = ByName(GetComponentsInChildren<MjHingeJoint>());
    _tendons = ByName(GetComponentsInChildren<MjBaseTendon>());
    var actuators = ByName(GetComponentsInChildren<MjActuator>());
    var missing = new List<string>();
    Note(_arm.names.joints, _joints.Keys, "joint", missing);
    Note(_arm.names.tendons, _tendons.Keys, "tendon", missing);
    Note(Array.ConvertAll(_arm.branches, branch => branch.tie), _tendons.Keys, "tendon", missing);
    Note(Array.ConvertAll(_arm.diagonals, diagonal => diagonal.tendon), _tendons.Keys, "tendon", missing);
    Note(Array.ConvertAll(_arm.actuators, actuator => actuator.name), actuators.Keys, "actuator", missing);
    if (missing.Count > 0) {
      Complain($"found no {missing[0]} below {name}, and {missing.Count - 1} more are missing, expected the arm of "
          + $"{ManifestFile.name}; it is held where it is");
      return false;
    }
    _actuators = Array.ConvertAll(_arm.actuators, actuator => actuators[actuator.name]);
    if (_pulls == null) {
      _pulls = new float[_actuators.Length];
    }
    return true;
  }

  private static Dictionary<string, T> ByName<T>(T[] found) where T : MjComponent {
    var named = new Dictionary<string, T>();
    foreach (var one in found) {
      named[one.name] = one;
    }
    return named;
  }

  private static void Note(string[] expected, ICollection<string> known, string kind, List<string> missing) {
    foreach (var one in expected) {
      if (!known.Contains(one)) {
        missing.Add($"{kind} {one}");
      }
    }
  }

  // MuJoCo's joint torque is -(a q + b q^2 + c q^3) for a spring and -(a v + b v|v| + c v^3) for a damper, and so is
  // the force of a diagonal, a tendon by which a round joint hardens by its whole bend. The importer knows one number
  // for each, so arm.xml holds straight lines and manifest.json the coefficients.
  private unsafe void RestoreLaws(MujocoLib.mjModel_* model) {
    foreach (var spring in _arm.springs) {
      Write(spring.coefficients, _joints[spring.joint].MujocoId, model->jnt_stiffness, model->jnt_stiffnesspoly);
    }
    foreach (var damper in _arm.dampers) {
      Write(damper.coefficients, _joints[damper.joint].DofAddress, model->dof_damping, model->dof_dampingpoly);
    }
    foreach (var diagonal in _arm.diagonals) {
      Write(diagonal.coefficients, _tendons[diagonal.tendon].MujocoId, model->tendon_stiffness,
            model->tendon_stiffnesspoly);
    }
  }

  private static unsafe void Write(double[] coefficients, int index, double* linear, double* higher) {
    linear[index] = coefficients[0];
    for (int order = 0; order < _higherOrders; order++) {
      higher[_higherOrders * index + order] = coefficients[1 + order];
    }
  }

  // Steps are taken with what rest does not know let go (the ties of joints that creep, friction), and all speeds are
  // set to 0 whenever the kinetic energy has passed a peak (dynamic relaxation with kinetic damping). All else in the
  // scene stands still meanwhile, and nothing of it but the arm's angles is kept.
  private unsafe void Settle(MujocoLib.mjModel_* model, MujocoLib.mjData_* data) {
    var ties = Array.ConvertAll(_arm.branches, branch => _tendons[branch.tie].MujocoId);
    var cables = Array.ConvertAll(_arm.names.tendons, tendon => _tendons[tendon].MujocoId);
    var joints = Array.ConvertAll(_arm.names.joints, joint => _joints[joint]);
    var dofs = Array.ConvertAll(joints, joint => joint.DofAddress);
    var places = Array.ConvertAll(joints, joint => joint.QposAddress);
    var stiffness = TakeOut(model->tendon_stiffness, ties);
    var cableFriction = TakeOut(model->tendon_frictionloss, cables);
    var jointFriction = TakeOut(model->dof_frictionloss, dofs);
    var scratch = MujocoLib.mj_makeData(model);
    for (int i = 0; i < _actuators.Length; i++) {
      scratch->ctrl[_actuators[i].MujocoId] = _activations[i];
      SetActivation(model, scratch, i, _activations[i]);
    }
    bool rests = LeadToRest(model, scratch, places, dofs);
    PutBack(model->tendon_stiffness, ties, stiffness);
    PutBack(model->tendon_frictionloss, cables, cableFriction);
    PutBack(model->dof_frictionloss, dofs, jointFriction);
    if (rests) {
      foreach (var branch in _arm.branches) {
        scratch->qpos[_joints[branch.branch].QposAddress] = scratch->qpos[_joints[branch.joint].QposAddress];
      }
      for (int i = 0; i < places.Length; i++) {
        data->qpos[places[i]] = scratch->qpos[places[i]];
        data->qvel[dofs[i]] = 0;
      }
    } else {
      double step = 1000 * model->opt.timestep;
      Complain(Invariant($"found no rest in {_mostSteps} steps of {step:F1} ms, expected one; ")
          + "the arm starts straight");
    }
    MujocoLib.mj_deleteData(scratch);
  }

  private static unsafe bool LeadToRest(MujocoLib.mjModel_* model, MujocoLib.mjData_* data, int[] places, int[] dofs) {
    var own = new bool[(int)model->nq];
    var moves = new bool[(int)model->nv];
    var last = new double[places.Length];
    for (int i = 0; i < places.Length; i++) {
      own[places[i]] = true;
      moves[dofs[i]] = true;
      last[i] = data->qpos[places[i]];
    }
    double energy = 0;
    for (int step = 0, since = 0, peaks = 0; step < _mostSteps; step++) {
      MujocoLib.mj_step(model, data);
      for (int i = 0; i < own.Length; i++) {
        data->qpos[i] = own[i] ? data->qpos[i] : model->qpos0[i];
      }
      for (int i = 0; i < moves.Length; i++) {
        data->qvel[i] = moves[i] ? data->qvel[i] : 0;
      }
      MujocoLib.mj_energyVel(model, data);
      since++;
      if (data->energy[1] >= energy && since < _longestRise) {
        energy = data->energy[1];
        continue;
      }
      energy = since = 0;
      double turned = 0;
      for (int i = 0; i < places.Length; i++) {
        data->qvel[dofs[i]] = 0;
        turned = Math.Max(turned, Math.Abs(data->qpos[places[i]] - last[i]));
        last[i] = data->qpos[places[i]];
      }
      peaks = turned < _still ? peaks + 1 : 0;
      if (peaks == _peaks) {
        return true;
      }
    }
    return false;
  }

  private static unsafe double[] TakeOut(double* values, int[] places) {
    var kept = new double[places.Length];
    for (int i = 0; i < places.Length; i++) {
      kept[i] = values[places[i]];
      values[places[i]] = 0;
    }
    return kept;
  }

  private static unsafe void PutBack(double* values, int[] places, double[] kept) {
    for (int i = 0; i < places.Length; i++) {
      values[places[i]] = kept[i];
    }
  }

  private unsafe void SetActivation(MujocoLib.mjModel_* model, MujocoLib.mjData_* data, int index, double value) {
    int address = model->actuator_actadr[_actuators[index].MujocoId];
    if (address >= 0) {
      data->act[address] = value;
    }
  }

  // MuJoCo would take a control that is none for 0 on all actuators, and the plug-in would stop the scene.
  private void HoldWhatIsBad() {
    for (int i = 0; i < _actuators.Length; i++) {
      var actuator = _actuators[i];
      if (!IsControl(actuator.Control)) {
        Complain(Invariant($"{actuator.name}: found the control {actuator.Control}, expected a finite number; it ")
            + Invariant($"stays at {_pulls[i]} m"));
        actuator.Control = _pulls[i];
      } else if (actuator.Control != _pulls[i]) {
        _pulls[i] = actuator.Control;
        _told = null;
      }
    }
  }

  private static bool IsControl(double value) {
    return Math.Abs(value) <= MujocoLib.mjMAXVAL;  // false for what is no number
  }

  private void Complain(string what) {
    if (what != _told) {
      _told = what;
      Debug.LogError($"Trunkline Twin: {what}", this);
    }
  }

  // A line before the camera, which a headset shows too; none without a text.
  private void Warn(string text) {
    if (text == null || Camera.main == null) {
      if (_warning != null) {
        Destroy(_warning.gameObject);
        _warning = null;
      }
      return;
    }
    if (_warning == null) {
      _warning = new GameObject("Trunkline warning").AddComponent<TextMesh>();
      _warning.transform.SetParent(Camera.main.transform, false);
      _warning.transform.localPosition = _ahead * Vector3.forward;
      _warning.font = Resources.GetBuiltinResource<Font>("LegacyRuntime.ttf");
      _warning.GetComponent<Renderer>().sharedMaterial = _warning.font.material;
      _warning.anchor = TextAnchor.MiddleCenter;
      _warning.alignment = TextAlignment.Center;
      _warning.characterSize = _letter;
      _warning.fontSize = 40;
      _warning.color = Color.yellow;
    }
    _warning.text = text.Replace(": ", ":\n");
  }
}
}
