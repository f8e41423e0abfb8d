using UnityEngine;
using static Trunkline.Vectors;

namespace Trunkline.Samples {

/// <summary>Bends the twin as it will bend on the robot. Its base goes to the rigid target, turned as it will be there,
/// so that gravity pulls on it from where the network was told; and its tip to the tip's target.</summary>
public class BendingTwin : MonoBehaviour {
  [Tooltip("m, by which the network may foresee the tip beside its target.")]
  public float Tolerance = 0.02f;

  public Pointing Pointing;
  public ArmNetwork Network;
  public Twin Twin;

  [Tooltip("An object with MuJoCo's Mj Mocap Body: the twin's root lies below it.")]
  public Transform Mount;

  [Tooltip("The twin's body `base`.")]
  public Transform Base;

  private const float _pause = 0.1f;  // s: a bend asks the network for hundreds of poses
  private const double _moved = 1e-3, _turned = 0.01;  // m, rad: targets that moved less are where they were

  private float _next;
  private bool _bent;
  private Vector _mount, _tip;
  private Quaternion _turn;
  private Vector3 _offset;  // of the base from the mount, which the importer has set
  private UnityEngine.Quaternion _baseTurn;

  protected void Awake() {
    var back = UnityEngine.Quaternion.Inverse(Mount.rotation);
    _offset = back * (Base.position - Mount.position);
    _baseTurn = back * Base.rotation;
  }

  protected void OnEnable() => Pointing.Stepped += Follow;

  protected void OnDisable() => Pointing.Stepped -= Follow;

  private void Follow(Intent intent) {
    var targets = intent.Targets;
    if (targets == null || targets.Rigid.Reach != Where.Inside || targets.Tip.Reach != Where.Inside
        || !Network.IsReady || Time.unscaledTime < _next) {
      return;
    }
    var turn = Alignment.BaseQuaternion(targets.Pointing, targets.Heading);
    if (_bent && Distance(targets.Rigid.Position, _mount) < _moved && Distance(targets.Tip.Position, _tip) < _moved
        && AngleBetween(turn, _turn) < _turned) {
      return;
    }
    _bent = true;
    _next = Time.unscaledTime + _pause;
    _mount = targets.Rigid.Position;
    _tip = targets.Tip.Position;
    _turn = turn;
    var back = Conjugate(turn);
    var tip = Rotate(back, Subtract(_tip, _mount));
    if (Network.Kinematics.TryBend(tip, Rotate(back, Down), Tolerance, out var answer)) {  // else the twin stays
      Place(Pointing.InScene(_mount), Pointing.InScene(turn));
      Twin.Send(answer.Commands);
    }
  }

  private void Place(Vector3? position, UnityEngine.Quaternion? turn) {
    if (position != null && turn != null) {
      var mount = turn.Value * UnityEngine.Quaternion.Inverse(_baseTurn);
      Mount.SetPositionAndRotation(position.Value - mount * _offset, mount);
    }
  }
}
}
