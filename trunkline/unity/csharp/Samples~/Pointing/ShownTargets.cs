using UnityEngine;

namespace Trunkline.Samples {

/// <summary>Shows the rays, the targets in the colour of their reach, and what is offered where one is out of
/// reach.</summary>
public class ShownTargets : MonoBehaviour {
  public Pointing Pointing;
  public LineRenderer LeftRay, RightRay;
  public Renderer Rigid, Tip, RigidOffer, TipOffer;

  protected void OnEnable() => Pointing.Stepped += Show;

  protected void OnDisable() => Pointing.Stepped -= Show;

  private void Show(Intent intent) {
    Draw(LeftRay, Pointing.LeftHand, Pointing.InScene(intent.LeftRay));
    Draw(RightRay, Pointing.RightHand, Pointing.InScene(intent.RightRay));
    Place(Rigid, intent.Targets?.Rigid);
    Place(Tip, intent.Targets?.Tip);
    Place(RigidOffer, Pointing.RigidOffer);
    Place(TipOffer, Pointing.TipOffer);
  }

  private static void Draw(LineRenderer ray, Transform hand, Vector3? end) {
    ray.enabled = end != null;
    if (end != null) {
      ray.SetPosition(0, hand.position);
      ray.SetPosition(1, end.Value);
    }
  }

  private void Place(Renderer ball, Target target) {
    Place(ball, Pointing.InScene(target?.Position));
    if (target != null) {
      ball.material.color = target.Reach == Where.Inside ? Color.green
          : target.Reach == Where.Unknown ? Color.yellow : Color.red;
    }
  }

  private static void Place(Renderer ball, Vector3? at) {
    ball.enabled = at != null;
    if (at != null) {
      ball.transform.position = at.Value;
    }
  }
}
}
