using UnityEngine;
using UnityEngine.XR;

namespace Trunkline.Samples {

/// <summary>Moves both hands' objects with the controllers, and tells Pointing what they hold.</summary>
public class TrackedHands : MonoBehaviour {
  public Pointing Pointing;

  protected void Update() {
    Pointing.Left = Follow(XRNode.LeftHand, Pointing.LeftHand);
    Pointing.Right = Follow(XRNode.RightHand, Pointing.RightHand);
  }

  private static HandInput Follow(XRNode node, Transform hand) {
    var device = InputDevices.GetDeviceAtXRNode(node);
    var held = new HandInput();
    bool placed = device.TryGetFeatureValue(CommonUsages.devicePosition, out Vector3 position)
        & device.TryGetFeatureValue(CommonUsages.deviceRotation, out UnityEngine.Quaternion rotation);
    if (placed) {
      hand.localPosition = position;
      hand.localRotation = rotation;
    }
    device.TryGetFeatureValue(CommonUsages.isTracked, out held.Tracked);
    held.Tracked &= placed;
    device.TryGetFeatureValue(CommonUsages.triggerButton, out held.Trigger);
    device.TryGetFeatureValue(CommonUsages.gripButton, out held.Grip);
    device.TryGetFeatureValue(CommonUsages.primary2DAxisClick, out held.StickPressed);
    device.TryGetFeatureValue(CommonUsages.primaryButton, out held.Primary);
    device.TryGetFeatureValue(CommonUsages.secondaryButton, out held.Secondary);
    device.TryGetFeatureValue(CommonUsages.primary2DAxis, out held.Stick);
    return held;
  }
}
}
