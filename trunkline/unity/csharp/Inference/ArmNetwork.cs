using System;
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

  /// <summary>Whether it started: what is missing or bad is one line in the console, and it is off.</summary>
  public bool IsReady => Kinematics != null;

  protected void Awake() {
    try {
      if (NetworkFile == null) {
        throw new InputError("Network File: found none, expected Runtime/Network/ik.onnx");
      }
      PackageFiles.Of(ManifestFile, out var manifest, out _);
      _network = new InferenceNetwork(NetworkFile);
      Kinematics = Unpacked.KinematicsOf(manifest, _network);
    } catch (Exception error) {  // the inference engine's own are of many types
      string why = error is InputError ? error.Message
          : $"{NetworkFile.name}: found that the inference engine does not run it ({error.Message.Split('\n')[0]}), "
              + "expected Runtime/Network/ik.onnx";
      Debug.LogError($"Arm Network: {why}", this);
      enabled = false;
    }
  }

  protected void OnDestroy() => _network?.Dispose();

  /// <summary>What brings the tip to a position within `tolerance`, m, under gravity in the direction `down`, of unit
  /// length: both in the arm's base frame, in Unity's axes.</summary>
  /// <exception cref="InputError">The arm comes no nearer, or the component is not ready.</exception>
  public Answer Bend(Vector3 tip, Vector3 down, float tolerance) =>
      Ready.Bend(UnityFrames.ToCore(tip), UnityFrames.ToCore(down), tolerance);

  /// <summary>The same without an exception where the arm comes no nearer: false, and the nearest answer; null under
  /// gravity that the network does not know.</summary>
  /// <exception cref="InputError">The component is not ready.</exception>
  public bool TryBend(Vector3 tip, Vector3 down, float tolerance, out Answer answer) =>
      Ready.TryBend(UnityFrames.ToCore(tip), UnityFrames.ToCore(down), tolerance, out answer);

  private ArmKinematics Ready => Kinematics ?? throw new InputError("Arm Network: found one that is not ready, "
      + "expected its two files; the console says what is wrong");
}
}
