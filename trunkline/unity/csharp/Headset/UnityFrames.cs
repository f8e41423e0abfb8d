using UnityEngine;

namespace Trunkline {

/// <summary>The core's vectors and rotations from Unity's and back, by <see cref="Frames"/>.</summary>
public static class UnityFrames {
  /// <summary>A position or direction in Unity's axes, in those of the core.</summary>
  public static Vector ToCore(Vector3 position) =>
      Frames.UnityPosition(new Vector(position.x, position.y, position.z));

  /// <summary>A rotation in Unity's axes, in those of the core.</summary>
  public static Quaternion ToCore(UnityEngine.Quaternion turn) =>
      Frames.UnityQuaternion(new Quaternion(turn.w, turn.x, turn.y, turn.z));

  public static Vector3 ToUnity(Vector position) {
    var there = Frames.UnityPosition(position);
    return new Vector3((float)there.X, (float)there.Y, (float)there.Z);
  }

  public static UnityEngine.Quaternion ToUnity(Quaternion turn) {
    var there = Frames.UnityQuaternion(turn);
    return new UnityEngine.Quaternion((float)there.X, (float)there.Y, (float)there.Z, (float)there.W);
  }
}
}
