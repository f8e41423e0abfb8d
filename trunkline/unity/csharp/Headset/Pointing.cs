using System;
using System.Collections.Generic;
using UnityEngine;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>What is held of one controller, and its stick (x right, y forward, -1 to 1).</summary>
[Serializable]
public struct HandInput {
  public bool Tracked, Trigger, Grip, StickPressed, Primary, Secondary;
  public Vector2 Stick;
}

/// <summary>Teleoperation by two rays without a server: each frame, two hands' transforms and buttons go into one
/// <see cref="Teleoperation.Step"/> of the core, and what it wants comes out.
///
/// A hand's ray is its transform's forward. The frame in which both are heard is the scene's, turned to right-handed
/// axes. Planning, preview and motion are the app's: it answers by `Plan`, `Shown` and `Executor`.</summary>
[AddComponentMenu("Trunkline/Pointing")]
[DisallowMultipleComponent]
public class Pointing : MonoBehaviour {

  [Tooltip("Runtime/manifest.json of this package.")]
  public TextAsset ManifestFile;

  [Tooltip("Runtime/teleoperation.json of this package, or settings of your own in its form.")]
  public TextAsset SettingsFile;

  [Tooltip("Of Runtime/Reachability: rigid.bytes, sheets.bytes and sheet_weights.bytes; in a package without sheets, "
      + "rigid.bytes and the soft grids that the manifest lists.")]
  public TextAsset[] MapFiles;

  [Tooltip("Controllers, tracked by the app: the ray is forward, up is up from the back of the hand.")]
  public Transform LeftHand, RightHand;

  [Tooltip("Where the rigid robot's base stands in the scene, its scale 1. None: not aligned, and the robot holds.")]
  public Transform RobotBase;

  /// <summary>Set by the app before each step.</summary>
  [NonSerialized] public HandInput Left, Right;
  /// <summary>Of the rigid robot, rad, seven; those of the manifest until the app sets them.</summary>
  [NonSerialized] public double[] Joints;
  [NonSerialized] public World World = new World("empty");
  [NonSerialized] public PlanReport Plan;
  [NonSerialized] public string Shown = "";
  [NonSerialized] public ExecutorReport Executor = new ExecutorReport();
  [NonSerialized] public Offer Offer;

  /// <summary>After each step, with what is wanted.</summary>
  public event Action<Intent> Stepped;
  /// <summary>With the new mode.</summary>
  public event Action<Mode> ModeChanged;
  /// <summary>When a plan is asked for; answer it by `Plan`, of the same serial.</summary>
  public event Action<Request> PlanAsked;

  /// <summary>Whether it started: what is missing or bad is one line in the console, and it is off.</summary>
  public bool IsReady => _core != null;

  /// <summary>Of the last step; null before the first.</summary>
  public Intent Intent { get; private set; }
  public State State { get; private set; }
  /// <summary>The package's digest.</summary>
  public string Package { get; private set; }
  /// <summary>The scene in the robot's base; null where there is none.</summary>
  public Pose Alignment { get; private set; }

  /// <summary>The nearest point within reach where a target is out of reach, in the scene; null where there is
  /// none.</summary>
  public Vector3? RigidOffer => InScene(Intent?.Targets?.Rigid.Offer);
  public Vector3? TipOffer => InScene(Intent?.Targets?.Tip.Offer);

  // A tracked base trembles; targets that are parked in it would be lost at each new place.
  private const double _still = 1e-4, _stillTurn = 2e-4;  // m, rad

  // From a hand as the core has it (ray along -z, y up) to one as Unity has it, in the core's axes (y ahead, z up).
  private static readonly Quaternion _ray = About(new Vector(1, 0, 0), Math.PI / 2);

  private Teleoperation _core;

  protected void Awake() {
    try {
      var files = PackageFiles.Of(ManifestFile, out var manifest, out string package,
                                  MapFiles ?? new TextAsset[0]);
      if (SettingsFile == null) {
        throw new InputError("Settings File: found none, expected Runtime/teleoperation.json");
      }
      var settings = Teleop.Read(new JsonBlock(Json.Read(SettingsFile.bytes, SettingsFile.name), SettingsFile.name));
      var robot = manifest.Block("hybrid").Block("robot");
      Package = package;
      Joints = Joints ?? robot.Numbers("ready");
      var core = new Teleoperation(settings, Unpacked.MapsOf(files, manifest), Package,
                                   robot.Number("mount_offset"));
      State = core.Start();
      _core = core;
    } catch (InputError error) {
      Debug.LogError($"Pointing: {error.Message}", this);
      enabled = false;
    }
  }

  protected void Update() => Step(Time.realtimeSinceStartupAsDouble, Time.unscaledDeltaTime);

  /// <summary>One step of the core, at `stamp` of this device's clock, s, `dt` s after the one before.</summary>
  /// <exception cref="InputError">The component is not ready.</exception>
  public void Step(double stamp, double dt) {
    if (!IsReady) {
      throw new InputError("Pointing: found one that is not ready, expected all its files; the console says what is "
          + "wrong");
    }
    Align();
    var given = new Input(stamp, Heard(LeftHand, Left), Heard(RightHand, Right), Alignment, Joints, World, Package,
                          Plan, Shown, Executor, Offer);
    var before = State.Mode;
    var asked = Intent?.Request;
    var (state, intent) = _core.Step(State, given, dt);
    State = state;
    Intent = intent;
    Stepped?.Invoke(intent);
    if (intent.Mode != before) {
      ModeChanged?.Invoke(intent.Mode);
    }
    if (intent.Request != null && intent.Request.Serial != asked?.Serial) {
      PlanAsked?.Invoke(intent.Request);
    }
  }

  /// <summary>Moves `RobotBase` to where touches say that the base stands: three or more places in the scene, and the
  /// same in the robot's base, m.</summary>
  /// <exception cref="InputError">They are too few, or one is no place, or they lie on a line, or four or more in a
  /// plane; or there is no `RobotBase`. It then stays where it is.</exception>
  public void AlignBase(IReadOnlyList<Vector3> touched, IReadOnlyList<Vector> robotBase) {
    if (RobotBase == null) {
      throw new InputError("Robot Base: found none, expected the object that shall stand where the robot's base does");
    }
    var reference = new List<Vector>();
    foreach (var place in touched) {
      reference.Add(UnityFrames.ToCore(place));
    }
    var found = robotBase.Count > 3 ? Aligning.Fit(reference, robotBase) : Aligning.FitThree(reference, robotBase);
    var there = Aligning.Inverse(found);
    RobotBase.SetPositionAndRotation(UnityFrames.ToUnity(there.Position), UnityFrames.ToUnity(there.Quaternion));
  }

  /// <summary>A place in the robot's base, m, in the scene; null where there is none, or no base.</summary>
  public Vector3? InScene(Vector? place) {
    if (place == null || Alignment == null) {
      return null;
    }
    return UnityFrames.ToUnity(Aligning.InBase(Aligning.Inverse(Alignment), place.Value));
  }

  /// <summary>A rotation in the robot's base, in the scene; null where there is no base.</summary>
  public UnityEngine.Quaternion? InScene(Quaternion turn) {
    if (Alignment == null) {
      return null;
    }
    return UnityFrames.ToUnity(Multiply(Aligning.Inverse(Alignment).Quaternion, turn));
  }

  private void Align() {
    if (RobotBase == null) {
      Alignment = null;
      return;
    }
    var there = new Pose(UnityFrames.ToCore(RobotBase.position), UnityFrames.ToCore(RobotBase.rotation));
    var found = Aligning.Inverse(there);
    bool same = Alignment != null && Distance(found.Position, Alignment.Position) < _still
        && AngleBetween(found.Quaternion, Alignment.Quaternion) < _stillTurn;
    Alignment = same ? Alignment : found;
  }

  private static Controller Heard(Transform hand, HandInput input) {
    if (hand == null) {
      return new Controller(new Vector(), Identity, tracked: false);
    }
    return new Controller(
        UnityFrames.ToCore(hand.position), Multiply(UnityFrames.ToCore(hand.rotation), _ray), input.Tracked,
        input.Trigger, input.Grip, input.Stick.x, input.Stick.y, input.StickPressed, input.Primary, input.Secondary);
  }
}
}
