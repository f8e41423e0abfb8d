using Unity.InferenceEngine;
using UnityEngine;

namespace Trunkline {

/// <summary>The package's inverse kinematics in a scene, by Unity's inference engine.</summary>
[AddComponentMenu("Trunkline/Arm Network")]
[DisallowMultipleComponent]
public class ArmNetwork : MonoBehaviour {

  [Tooltip("Runtime/manifest.json of this package.")]
  public TextAsset ManifestFile;

  [Tooltip("Runtime/Network/ik.onnx of this package.")]
  public ModelAsset NetworkFile;

  private InferenceNetwork _network;

  /// <summary>Gravity and tip to the motors' commands; null where a file is missing or is another's.</summary>
  public ArmKinematics Kinematics { get; private set; }

  protected void Awake() {
    try {
      if (NetworkFile == null) {
        throw new InputError("Network File: found none, expected Runtime/Network/ik.onnx");
      }
      var files = PackageFiles.Of(ManifestFile);
      _network = new InferenceNetwork(NetworkFile);
      Kinematics = Unpacked.KinematicsOf(files, _network);
    } catch (InputError error) {
      Debug.LogError($"Arm Network: {error.Message}", this);
      enabled = false;
    }
  }

  protected void OnDestroy() => _network?.Dispose();

  /// <summary>What brings the tip to a position within `tolerance`, m, under gravity in the direction `down`, of unit
  /// length: both in the arm's base frame, in Unity's axes.</summary>
  /// <exception cref="InputError">The arm comes no nearer.</exception>
  public Answer Bend(Vector3 tip, Vector3 down, float tolerance) =>
      Kinematics.Bend(UnityFrames.ToCore(tip), UnityFrames.ToCore(down), tolerance);
}
}
