using UnityEngine;
using static Trunkline.Vectors;

namespace Trunkline.Samples {

/// <summary>Bends the twin as it will bend on the robot: the tip target as seen from the mount, under the gravity that
/// the arm will have there. The twin's own mount stays where it is, straight down.</summary>
public class BendingTwin : MonoBehaviour {
  [Tooltip("m, by which the network may foresee the tip beside its target.")]
  public float Tolerance = 0.02f;

  public Pointing Pointing;
  public ArmNetwork Network;
  public Twin Twin;

  private Targets _last;

  protected void OnEnable() => Pointing.Stepped += Follow;

  protected void OnDisable() => Pointing.Stepped -= Follow;

  private void Follow(Intent intent) {
    var targets = intent.Targets;
    if (targets == null || targets == _last || targets.Tip.Reach != Where.Inside || Network.Kinematics == null) {
      return;
    }
    _last = targets;
    var back = Conjugate(Alignment.BaseQuaternion(targets.Pointing, targets.Heading));
    var tip = Rotate(back, Subtract(targets.Tip.Position, targets.Rigid.Position));
    try {
      Twin.Send(Network.Kinematics.Bend(tip, Rotate(back, Down), Tolerance).Commands);
    } catch (InputError) {  // no bend comes so near: the twin stays as it is
    }
  }
}
}
