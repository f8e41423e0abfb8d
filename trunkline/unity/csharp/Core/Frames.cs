namespace Trunkline {

/// <summary>From MuJoCo's frame (right-handed, z up) to Unity's (left-handed, y up), and back: y and z change places,
/// so each of these is its own inverse. Port of trunkline/unity/frame.py.
///
/// The map is a reflection, so rotations keep their axis, mapped, and turn the other way.</summary>
public static class Frames {
  /// <summary>A position, m, a direction or a velocity, m/s.</summary>
  public static Vector UnityPosition(Vector position) => new Vector(position.X, position.Z, position.Y);

  /// <summary>A rotation; (w, x, y, z) becomes x: x, y: z, z: y, w: -w.</summary>
  public static Quaternion UnityQuaternion(Quaternion q) => new Quaternion(-q.W, q.X, q.Z, q.Y);

  /// <summary>The angular velocity of a twist, rad/s. Its linear velocity is mapped as a position.</summary>
  public static Vector UnityAngularVelocity(Vector spin) => new Vector(-spin.X, -spin.Z, -spin.Y);
}
}
