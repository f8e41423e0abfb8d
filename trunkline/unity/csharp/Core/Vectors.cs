using System;

namespace Trunkline {

/// <summary>Three numbers along the axes of a right-handed frame; in m where it is a place.</summary>
public readonly struct Vector : IEquatable<Vector> {
  /// <summary>Along x.</summary>
  public readonly double X;
  /// <summary>Along y.</summary>
  public readonly double Y;
  /// <summary>Along z.</summary>
  public readonly double Z;

  /// <summary>As the fields of the same names.</summary>
  public Vector(double x, double y, double z) {
    X = x;
    Y = y;
    Z = z;
  }

  /// <summary>The same numbers.</summary>
  public static bool operator ==(Vector a, Vector b) => a.X == b.X && a.Y == b.Y && a.Z == b.Z;

  /// <summary>Another number.</summary>
  public static bool operator !=(Vector a, Vector b) => !(a == b);

  /// <summary>The same numbers.</summary>
  public bool Equals(Vector other) => this == other;

  /// <inheritdoc/>
  public override bool Equals(object other) => other is Vector vector && this == vector;

  /// <inheritdoc/>
  public override int GetHashCode() => X.GetHashCode() ^ (397 * Y.GetHashCode()) ^ (7919 * Z.GetHashCode());
}

/// <summary>A rotation as a unit quaternion (w, x, y, z); the constructor takes w first and does not scale it, and
/// q and -q are the same rotation but not equal.</summary>
public readonly struct Quaternion : IEquatable<Quaternion> {
  /// <summary>Cosine of half the angle.</summary>
  public readonly double W;
  /// <summary>Sine of half the angle, times the axis along x.</summary>
  public readonly double X;
  /// <summary>The same along y.</summary>
  public readonly double Y;
  /// <summary>The same along z.</summary>
  public readonly double Z;

  /// <summary>As the fields of the same names.</summary>
  public Quaternion(double w, double x, double y, double z) {
    W = w;
    X = x;
    Y = y;
    Z = z;
  }

  /// <summary>The same numbers.</summary>
  public static bool operator ==(Quaternion a, Quaternion b) => a.W == b.W && a.X == b.X && a.Y == b.Y && a.Z == b.Z;

  /// <summary>Another number.</summary>
  public static bool operator !=(Quaternion a, Quaternion b) => !(a == b);

  /// <summary>The same numbers.</summary>
  public bool Equals(Quaternion other) => this == other;

  /// <inheritdoc/>
  public override bool Equals(object other) => other is Quaternion quaternion && this == quaternion;

  /// <inheritdoc/>
  public override int GetHashCode() =>
      W.GetHashCode() ^ (31 * X.GetHashCode()) ^ (397 * Y.GetHashCode()) ^ (7919 * Z.GetHashCode());
}

/// <summary>Arithmetic of both: trunkline/ar/teleop/vectors.py.</summary>
public static class Vectors {
  /// <summary>No rotation.</summary>
  public static readonly Quaternion Identity = new Quaternion(1, 0, 0, 0);
  /// <summary>Along -z, unit length: gravity's direction in the rigid robot's base frame.</summary>
  public static readonly Vector Down = new Vector(0, 0, -1);

  /// <summary>a + b.</summary>
  public static Vector Add(Vector a, Vector b) => new Vector(a.X + b.X, a.Y + b.Y, a.Z + b.Z);

  /// <summary>a - b.</summary>
  public static Vector Subtract(Vector a, Vector b) => new Vector(a.X - b.X, a.Y - b.Y, a.Z - b.Z);

  /// <summary>A vector times a factor.</summary>
  public static Vector Scale(Vector a, double factor) => new Vector(factor * a.X, factor * a.Y, factor * a.Z);

  /// <summary>a · b.</summary>
  public static double Dot(Vector a, Vector b) => a.X * b.X + a.Y * b.Y + a.Z * b.Z;

  /// <summary>a × b, right-handed.</summary>
  public static Vector Cross(Vector a, Vector b) =>
      new Vector(a.Y * b.Z - a.Z * b.Y, a.Z * b.X - a.X * b.Z, a.X * b.Y - a.Y * b.X);

  /// <summary>Its length.</summary>
  public static double Norm(Vector a) => Math.Sqrt(Dot(a, a));

  /// <summary>From a to b.</summary>
  public static double Distance(Vector a, Vector b) => Norm(Subtract(a, b));

  /// <summary><paramref name="angle"/> from -π to less than π, rad.</summary>
  public static double Wrapped(double angle) {
    double turned = (angle + Math.PI) % (2 * Math.PI);
    return (turned < 0 ? turned + 2 * Math.PI : turned) - Math.PI;
  }

  /// <summary>The rotation <paramref name="q"/>, then <paramref name="p"/>.</summary>
  public static Quaternion Multiply(Quaternion p, Quaternion q) => new Quaternion(
      p.W * q.W - p.X * q.X - p.Y * q.Y - p.Z * q.Z,
      p.W * q.X + p.X * q.W + p.Y * q.Z - p.Z * q.Y,
      p.W * q.Y - p.X * q.Z + p.Y * q.W + p.Z * q.X,
      p.W * q.Z + p.X * q.Y - p.Y * q.X + p.Z * q.W);

  /// <summary>Of a unit quaternion: the rotation back.</summary>
  public static Quaternion Conjugate(Quaternion q) => new Quaternion(q.W, -q.X, -q.Y, -q.Z);

  /// <summary><paramref name="v"/> turned by the unit quaternion <paramref name="q"/>.</summary>
  public static Vector Rotate(Quaternion q, Vector v) {
    var u = new Vector(q.X, q.Y, q.Z);
    var t = Scale(Cross(u, v), 2);
    return Add(Add(v, Scale(t, q.W)), Cross(u, t));
  }

  /// <summary>The rotation by <paramref name="angle"/>, rad, about an <paramref name="axis"/> of unit length.</summary>
  public static Quaternion About(Vector axis, double angle) {
    double s = Math.Sin(angle / 2);
    return new Quaternion(Math.Cos(angle / 2), s * axis.X, s * axis.Y, s * axis.Z);
  }

  /// <summary>1 of a rotation.</summary>
  public static double Length(Quaternion q) => Math.Sqrt(q.W * q.W + q.X * q.X + q.Y * q.Y + q.Z * q.Z);

  /// <summary>Scaled to unit length; not a number where all are 0.</summary>
  public static Quaternion Unit(Quaternion q) {
    double length = Length(q);
    return new Quaternion(q.W / length, q.X / length, q.Y / length, q.Z / length);
  }

  /// <summary>Angle of the rotation from <paramref name="p"/> to <paramref name="q"/>, rad, in [0, π].</summary>
  public static double AngleBetween(Quaternion p, Quaternion q) {
    var r = Multiply(Conjugate(p), q);
    return 2 * Math.Atan2(Math.Sqrt(r.X * r.X + r.Y * r.Y + r.Z * r.Z), Math.Abs(r.W));
  }

  /// <summary><paramref name="p"/> turned by a <paramref name="share"/>, 0 to 1, of the shortest way to
  /// <paramref name="q"/> (slerp; Shoemake 1985).</summary>
  public static Quaternion Toward(Quaternion p, Quaternion q, double share) {
    var r = Multiply(Conjugate(p), q);
    if (r.W < 0) {
      r = new Quaternion(-r.W, -r.X, -r.Y, -r.Z);
    }
    double sine = Math.Sqrt(r.X * r.X + r.Y * r.Y + r.Z * r.Z);
    if (sine < 1e-12) {
      return p;
    }
    double half = Math.Atan2(sine, r.W);
    return Unit(Multiply(p, About(new Vector(r.X / sine, r.Y / sine, r.Z / sine), 2 * half * share)));
  }

  /// <summary>The least rotation that turns the direction <paramref name="a"/> into <paramref name="b"/>, both of unit
  /// length and not opposite.</summary>
  public static Quaternion LeastRotation(Vector a, Vector b) {
    var c = Cross(a, b);
    return Unit(new Quaternion(1 + Dot(a, b), c.X, c.Y, c.Z));
  }

  internal static bool IsFinite(double value) => !double.IsNaN(value) && !double.IsInfinity(value);

  internal static bool IsFinite(Vector a) => IsFinite(a.X) && IsFinite(a.Y) && IsFinite(a.Z);

  internal static bool IsFinite(Quaternion q) => IsFinite(q.W) && IsFinite(q.X) && IsFinite(q.Y) && IsFinite(q.Z);

  internal static double Radians(double degrees) => degrees * (Math.PI / 180);

  internal static double Hypot(double a, double b) => Math.Sqrt(a * a + b * b);
}
}
