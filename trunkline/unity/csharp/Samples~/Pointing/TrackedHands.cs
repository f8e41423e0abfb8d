using System.Collections.Generic;
using UnityEngine;
using UnityEngine.XR;

namespace Trunkline.Samples {

/// <summary>Moves both hands' objects with the controllers and the camera with the head, tells Pointing what the hands
/// hold, and the twin at what rate the headset shows frames.</summary>
public class TrackedHands : MonoBehaviour {
  public Pointing Pointing;
  public Twin Twin;

  [Tooltip("The camera. None: an app's own rig moves it.")]
  public Transform Head;

  private readonly List<XRDisplaySubsystem> _displays = new List<XRDisplaySubsystem>();
  private readonly List<XRInputSubsystem> _inputs = new List<XRInputSubsystem>();
  private float _rate;
  private bool _onFloor;

  protected void Update() {
    AskHeadset();
    if (Head != null) {
      Place(InputDevices.GetDeviceAtXRNode(XRNode.CenterEye), Head);
    }
    Pointing.Left = Follow(XRNode.LeftHand, Pointing.LeftHand);
    Pointing.Right = Follow(XRNode.RightHand, Pointing.RightHand);
  }

  // Its plug-in may start later than the scene, and the user may change the rate.
  private void AskHeadset() {
    SubsystemManager.GetSubsystems(_displays);
    foreach (var display in _displays) {
      if (display.running && display.TryGetDisplayRefreshRate(out float rate) && rate > 0 && rate != _rate) {
        _rate = rate;
        Twin.SetDisplayRate(rate);
      }
    }
    if (_onFloor) {
      return;
    }
    SubsystemManager.GetSubsystems(_inputs);
    foreach (var input in _inputs) {
      _onFloor |= input.running && input.TrySetTrackingOriginMode(TrackingOriginModeFlags.Floor);
    }
  }

  private static bool Place(InputDevice device, Transform moved) {
    bool placed = device.TryGetFeatureValue(CommonUsages.devicePosition, out Vector3 position)
        & device.TryGetFeatureValue(CommonUsages.deviceRotation, out UnityEngine.Quaternion rotation);
    if (placed) {
      moved.localPosition = position;
      moved.localRotation = rotation;
    }
    return placed;
  }

  private static HandInput Follow(XRNode node, Transform hand) {
    var device = InputDevices.GetDeviceAtXRNode(node);
    var held = new HandInput();
    bool placed = Place(device, hand);
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
