using System;
using UnityEngine;

namespace Trunkline {

/// <summary>What the soft arm reaches under the gravity that pulls on it now, from any side: the core's
/// <see cref="SheetReach"/> in the frame of the model's body `base`, in Unity's axes. Put it on that object.</summary>
[AddComponentMenu("Trunkline/Soft Reach")]
[DisallowMultipleComponent]
public class SoftReach : MonoBehaviour {

  [Tooltip("Runtime/manifest.json of this package.")]
  public TextAsset ManifestFile;

  [Tooltip("Runtime/Reachability/sheets.bytes of this package.")]
  public TextAsset PointsFile;

  [Tooltip("Runtime/Reachability/sheet_weights.bytes of this package.")]
  public TextAsset WeightsFile;

  private const double _same = 1e-4;  // of a unit vector: gravity that has turned less leaves the surface as it is

  private SheetReach _reach;
  private Vector _down;
  private Vector3[] _points;

  /// <summary>The direction of gravity as the network takes it: base frame, unit length. The sensor is the scene's own
  /// gravity.</summary>
  public static Vector3 NetworkGravity(Transform armBase) {
    var down = DownOf(armBase);
    return new Vector3(down.x, down.z, down.y);
  }

  /// <summary>The same in Unity's axes, as this component takes it.</summary>
  public static Vector3 DownOf(Transform armBase) => armBase.InverseTransformDirection(Physics.gravity).normalized;

  /// <summary>Points of the surface under the gravity that was last given, one way around the arm after the other, to
  /// draw. They are summed when they are asked for.</summary>
  /// <exception cref="InputError">The component is not ready.</exception>
  public Vector3[] Points => _points = _points ?? Array.ConvertAll(Ready.Surface(_down), UnityFrames.ToUnity);

  /// <summary>Whether gravity is one that the package knows; it is not where the arm points far up.</summary>
  /// <exception cref="InputError">The component is not ready.</exception>
  public bool Known => Ready.Knows(_down);

  /// <summary>Whether it started: what is missing or bad is one line in the console, and it is off.</summary>
  public bool IsReady => _reach != null;

  private SheetReach Ready => _reach ?? throw new InputError("Soft Reach: found one that is not ready, expected its "
      + "three files; the console says what is wrong");

  protected void Awake() {
    try {
      var files = PackageFiles.Of(ManifestFile, out var manifest, out _, PointsFile, WeightsFile);
      _reach = Unpacked.SheetsOf(files, manifest) ?? throw new InputError("reach.sheets: found none, expected a "
          + "package for gravity from any side");
      SetGravity(DownOf(transform));
    } catch (InputError error) {
      Debug.LogError($"Soft Reach: {error.Message}", this);
      enabled = false;
    }
  }

  protected void Update() => SetGravity(DownOf(transform));

  /// <summary>Gravity in the direction `down`, of unit length, in Unity's axes.</summary>
  public void SetGravity(Vector3 down) {
    var given = UnityFrames.ToCore(down);
    if (Vectors.Distance(given, _down) >= _same) {
      _down = given;
      _points = null;
    }
  }

  /// <summary>About how far a position in the arm's base frame, in Unity's axes, is out of reach, m: above 0 it is. And
  /// the point of the surface that is nearest to it.</summary>
  /// <exception cref="InputError">The position is no number, or the component is not ready.</exception>
  public float Signal(Vector3 position, out Vector3 nearest) {
    double outside = Ready.Signal(UnityFrames.ToCore(position), _down, out var found);
    nearest = UnityFrames.ToUnity(found);
    return (float)outside;
  }
}
}
