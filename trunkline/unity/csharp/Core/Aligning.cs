using System;
using System.Collections.Generic;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>From touches to where the headset's frame stands in the robot's base: the fit of
/// trunkline/ar/session/registration.py. What is touched is a mark on the flange, whose place the robot itself knows. Both frames
/// are right-handed, m; `Frames` converts from Unity's.</summary>
public static class Aligning {
  private const int _fewest = 4;  // touches, of which one may be left out
  private const double _flat = 0.03;  // m, root mean square by which touches must leave the nearest plane, or line
  private const int _sweeps = 50;  // of Jacobi's method, which needs a handful

  /// <summary>The pose of the reference frame in the base for which touches in both are nearest (Kabsch, 1976; the
  /// rotation by Horn, 1987).</summary>
  /// <exception cref="InputError">There are too few, one is no place, or they lie in a plane.</exception>
  public static Pose Fit(IReadOnlyList<Vector> reference, IReadOnlyList<Vector> robotBase) {
    if (robotBase.Count < _fewest) {
      throw new InputError($"touches: found {robotBase.Count}, expected at least {_fewest}");
    }
    RequireFinite(reference, robotBase);
    double offPlane = Spread(robotBase, 2);
    if (offPlane < _flat) {
      throw new InputError($"touches: found all within {Formats.Fixed(1e3 * offPlane, 0)} mm of a plane, expected "
          + $"{Formats.Fixed(1e3 * _flat, 0)} mm: touch higher and lower ones");
    }
    return Nearest(reference, robotBase);
  }

  /// <summary>The same of three touches. None is left over then to tell that one of them is wrong.</summary>
  /// <exception cref="InputError">There are fewer, one is no place, or they lie on a line.</exception>
  public static Pose FitThree(IReadOnlyList<Vector> reference, IReadOnlyList<Vector> robotBase) {
    if (robotBase.Count < 3) {
      throw new InputError($"touches: found {robotBase.Count}, expected at least 3");
    }
    RequireFinite(reference, robotBase);
    double offLine = Spread(robotBase, 1);
    if (offLine < _flat) {
      throw new InputError($"touches: found all within {Formats.Fixed(1e3 * offLine, 0)} mm of a line, expected "
          + $"{Formats.Fixed(1e3 * _flat, 0)} mm: touch one further beside it");
    }
    return Nearest(reference, robotBase);
  }

  private static void RequireFinite(IReadOnlyList<Vector> reference, IReadOnlyList<Vector> robotBase) {
    for (int i = 0; i < robotBase.Count; i++) {
      MapReach.Require($"touch {i + 1}", reference[i]);
      MapReach.Require($"touch {i + 1}", robotBase[i]);
    }
  }

  /// <summary>A point of the reference frame in the base, m.</summary>
  public static Vector InBase(Pose pose, Vector point) => Add(pose.Position, Rotate(pose.Quaternion, point));

  /// <summary>How far each touch is from where the fit has it, m.</summary>
  public static double[] Residuals(Pose pose, IReadOnlyList<Vector> reference, IReadOnlyList<Vector> robotBase) {
    var found = new double[robotBase.Count];
    for (int i = 0; i < found.Length; i++) {
      found[i] = Distance(InBase(pose, reference[i]), robotBase[i]);
    }
    return found;
  }

  /// <summary>Of the fit at <paramref name="point"/> of the base, m, root mean square (Fitzpatrick, West, Maurer,
  /// 1998); the equation is in trunkline/ar/session/registration.py.</summary>
  public static double ExpectedError(Pose pose, IReadOnlyList<Vector> reference, IReadOnlyList<Vector> robotBase,
                                     Vector point) {
    int count = robotBase.Count;
    double located = 0;
    foreach (double missed in Residuals(pose, reference, robotBase)) {
      located += missed * missed / (count - 2);
    }
    var centre = Mean(robotBase);
    Eigen(Scatter(robotBase), out _, out var axes);
    double lever = 0;
    for (int k = 0; k < 3; k++) {
      var axis = new Vector(axes[0, k], axes[1, k], axes[2, k]);
      double mean = 0;
      foreach (var touched in robotBase) {
        mean += Beside(Subtract(touched, centre), axis) / count;
      }
      lever += Beside(Subtract(point, centre), axis) / mean / 3;
    }
    return Math.Sqrt(located / count * (1 + lever));
  }

  /// <summary>Angle between the headset's vertical and the robot's, rad.</summary>
  public static double Tilt(Pose pose) =>
      Math.Acos(Math.Min(Math.Max(Rotate(pose.Quaternion, new Vector(0, 1, 0)).Z, -1), 1));

  /// <summary>The other way round.</summary>
  public static Pose Inverse(Pose pose) {
    var back = Conjugate(pose.Quaternion);
    return new Pose(Scale(Rotate(back, pose.Position), -1), Canonical(back));
  }

  /// <summary><paramref name="inner"/> of a frame that is itself at <paramref name="outer"/>.</summary>
  public static Pose After(Pose outer, Pose inner) =>
      new Pose(InBase(outer, inner.Position), Canonical(Multiply(outer.Quaternion, inner.Quaternion)));

  // Square of the distance from an axis through the origin.
  private static double Beside(Vector away, Vector axis) {
    double along = Dot(away, axis);
    return Dot(away, away) - along * along;
  }

  private static Pose Nearest(IReadOnlyList<Vector> reference, IReadOnlyList<Vector> robotBase) {
    Vector middle = Mean(reference), centre = Mean(robotBase);
    var s = new double[3, 3];
    for (int i = 0; i < robotBase.Count; i++) {
      AddProduct(s, Subtract(reference[i], middle), Subtract(robotBase[i], centre));
    }
    // The quaternion is the eigenvector of the largest eigenvalue (B. Horn, J. Opt. Soc. Am. A 4, 1987).
    var n = new double[4, 4];
    n[0, 0] = s[0, 0] + s[1, 1] + s[2, 2];
    n[1, 1] = s[0, 0] - s[1, 1] - s[2, 2];
    n[2, 2] = -s[0, 0] + s[1, 1] - s[2, 2];
    n[3, 3] = -s[0, 0] - s[1, 1] + s[2, 2];
    n[0, 1] = n[1, 0] = s[1, 2] - s[2, 1];
    n[0, 2] = n[2, 0] = s[2, 0] - s[0, 2];
    n[0, 3] = n[3, 0] = s[0, 1] - s[1, 0];
    n[1, 2] = n[2, 1] = s[0, 1] + s[1, 0];
    n[1, 3] = n[3, 1] = s[2, 0] + s[0, 2];
    n[2, 3] = n[3, 2] = s[1, 2] + s[2, 1];
    Eigen(n, out var values, out var vectors);
    int best = 0;
    for (int k = 1; k < 4; k++) {
      best = values[k] > values[best] ? k : best;
    }
    var turn = Canonical(Unit(
        new Quaternion(vectors[0, best], vectors[1, best], vectors[2, best], vectors[3, best])));
    return new Pose(Subtract(centre, Rotate(turn, middle)), turn);
  }

  private static Quaternion Canonical(Quaternion q) {
    double sign = q.W != 0 ? q.W : q.X != 0 ? q.X : q.Y != 0 ? q.Y : q.Z;
    return sign < 0 ? new Quaternion(-q.W, -q.X, -q.Y, -q.Z) : q;
  }

  private static Vector Mean(IReadOnlyList<Vector> points) {
    var sum = new Vector();
    foreach (var point in points) {
      sum = Add(sum, point);
    }
    return Scale(sum, 1.0 / points.Count);
  }

  // Root mean square by which points leave the plane nearest to them (`smaller` 2), or their line, aside (1).
  private static double Spread(IReadOnlyList<Vector> points, int smaller) {
    Eigen(Scatter(points), out var values, out _);
    Array.Sort(values);
    return Math.Sqrt(Math.Max(values[2 - smaller], 0) / points.Count);
  }

  private static double[,] Scatter(IReadOnlyList<Vector> points) {
    var centre = Mean(points);
    var sum = new double[3, 3];
    foreach (var point in points) {
      var away = Subtract(point, centre);
      AddProduct(sum, away, away);
    }
    return sum;
  }

  private static void AddProduct(double[,] sum, Vector a, Vector b) {
    double[] left = { a.X, a.Y, a.Z }, right = { b.X, b.Y, b.Z };
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < 3; j++) {
        sum[i, j] += left[i] * right[j];
      }
    }
  }

  // Eigenvalues and eigenvectors, in columns, of a symmetric matrix, by Jacobi's rotations.
  private static void Eigen(double[,] given, out double[] values, out double[,] vectors) {
    int size = given.GetLength(0);
    var a = (double[,])given.Clone();
    vectors = new double[size, size];
    values = new double[size];
    for (int i = 0; i < size; i++) {
      vectors[i, i] = 1;
    }
    for (int sweep = 0; sweep < _sweeps; sweep++) {
      double off = 0;
      for (int p = 0; p < size; p++) {
        for (int q = p + 1; q < size; q++) {
          off += a[p, q] * a[p, q];
          Turn(a, vectors, p, q);
        }
      }
      if (off == 0) {
        break;
      }
    }
    for (int i = 0; i < size; i++) {
      values[i] = a[i, i];
    }
  }

  private static void Turn(double[,] a, double[,] vectors, int p, int q) {
    if (a[p, q] == 0) {
      return;
    }
    double theta = (a[q, q] - a[p, p]) / (2 * a[p, q]);
    double t = (theta < 0 ? -1 : 1) / (Math.Abs(theta) + Math.Sqrt(theta * theta + 1));
    double c = 1 / Math.Sqrt(t * t + 1), s = t * c;
    int size = a.GetLength(0);
    for (int i = 0; i < size; i++) {
      double first = a[i, p], second = a[i, q];
      a[i, p] = c * first - s * second;
      a[i, q] = s * first + c * second;
    }
    for (int i = 0; i < size; i++) {
      double first = a[p, i], second = a[q, i];
      a[p, i] = c * first - s * second;
      a[q, i] = s * first + c * second;
      first = vectors[i, p];
      second = vectors[i, q];
      vectors[i, p] = c * first - s * second;
      vectors[i, q] = s * first + c * second;
    }
  }
}
}
