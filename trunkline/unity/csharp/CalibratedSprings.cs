// Gives the arm its calibrated springs and dampers back, which MuJoCo's importer cannot read.
//
// MuJoCo's joint torque is -(a q + b q^2 + c q^3) for a spring and -(a v + b v|v| + c v^3) for a damper,
// and so is the force of a diagonal, a tendon by which a round joint hardens by its whole bend.
// The importer knows one number for each, so arm.xml holds straight lines and manifest.json the
// coefficients. This component writes them into every model that MjScene compiles.

using System;
using Mujoco;
using UnityEngine;

namespace Trunkline {

[AddComponentMenu("Trunkline/Calibrated Springs")]
[DisallowMultipleComponent]
public class CalibratedSprings : MonoBehaviour {

  [Tooltip("Runtime/manifest.json of this package.")]
  public TextAsset ManifestFile;

  // The part of the manifest that is read. JsonUtility goes by these names and skips all others.
  [Serializable]
  public class Manifest {
    public Model model;
  }

  [Serializable]
  public class Model {
    public JointLaw[] springs;
    public JointLaw[] dampers;
    public TendonLaw[] diagonals;
  }

  [Serializable]
  public class JointLaw {
    public string joint;
    public double[] coefficients;
  }

  [Serializable]
  public class TendonLaw {
    public string tendon;
    public double[] coefficients;
  }

  private const int _higherOrders = 2;  // mjNPOLY: b and c

  private Model _calibrated;

  protected void OnEnable() {
    if (ManifestFile == null) {
      Debug.LogError("Calibrated Springs: found no Manifest File, expected Runtime/manifest.json", this);
      return;
    }
    _calibrated = JsonUtility.FromJson<Manifest>(ManifestFile.text).model;
    // Raised for the first model and each later one: MjScene compiles anew whenever a component of
    // MuJoCo's comes or goes, and may get the same address for it.
    MjScene.Instance.postInitEvent += OnModelCompiled;
    Restore();
  }

  protected void OnDisable() {
    if (MjScene.InstanceExists) {
      MjScene.Instance.postInitEvent -= OnModelCompiled;
    }
  }

  private void OnModelCompiled(object sender, EventArgs args) {
    Restore();
  }

  private unsafe void Restore() {
    var model = MjScene.Instance.Model;
    if (model == null) {
      return;
    }
    var joints = GetComponentsInChildren<MjHingeJoint>();
    foreach (var spring in _calibrated.springs) {
      foreach (var joint in Find(spring, joints)) {
        Write(spring.coefficients, joint.MujocoId, model->jnt_stiffness, model->jnt_stiffnesspoly);
      }
    }
    foreach (var damper in _calibrated.dampers) {
      foreach (var joint in Find(damper, joints)) {
        Write(damper.coefficients, joint.DofAddress, model->dof_damping, model->dof_dampingpoly);
      }
    }
    var tendons = GetComponentsInChildren<MjFixedTendon>();
    foreach (var diagonal in _calibrated.diagonals) {
      var found = Array.FindAll(tendons, tendon => tendon.name == diagonal.tendon);
      if (found.Length == 0) {
        Debug.LogError($"Calibrated Springs: found no tendon {diagonal.tendon} below {name}, expected one", this);
      }
      // One that has just been added has no number before the next model, which is then due.
      foreach (var tendon in Array.FindAll(found, tendon => tendon.MujocoId >= 0)) {
        Write(diagonal.coefficients, tendon.MujocoId, model->tendon_stiffness, model->tendon_stiffnesspoly);
      }
    }
  }

  // The joints of that name in the model; the importer names each object after its MJCF element.
  private MjHingeJoint[] Find(JointLaw law, MjHingeJoint[] joints) {
    var found = Array.FindAll(joints, joint => joint.name == law.joint);
    if (found.Length == 0) {
      Debug.LogError($"Calibrated Springs: found no joint {law.joint} below {name}, expected one", this);
    }
    // A joint that has just been added has no address before the next model, which is then due.
    return Array.FindAll(found, joint => joint.DofAddress >= 0);
  }

  private static unsafe void Write(double[] coefficients, int index, double* linear, double* higher) {
    linear[index] = coefficients[0];
    for (int order = 0; order < _higherOrders; order++) {
      higher[_higherOrders * index + order] = coefficients[1 + order];
    }
  }
}
}
