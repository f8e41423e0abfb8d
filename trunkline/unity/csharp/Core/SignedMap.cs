using System;
using System.Collections.Generic;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>Signed distance s at a point, m, negative within reach, and its gradient there, without a unit.</summary>
public delegate double Signal(Vector point, out Vector slope);

/// <summary>A map as a signed distance on a lattice, and the nearest point within it: trunkline/ar/teleop/signed_map.py.
///
/// The signal s at a point is trilinear between lattice points, negative inside. Outside, the nearest point is looked
/// for down the signal's gradient. Where that leads further away than the nearest lattice point that is inside, that
/// is taken, and as much of the way from there as is inside.</summary>
public sealed class SignedMap {
  private const double _depth = 5e-4;  // m inside of the surface to which steps down the gradient go
  private const int _projections = 5;  // most of them; of a distance, one is enough
  private const int _halvings = 7;  // of the way from the nearest lattice point that is inside: to 1/128 of it
  private const double _flat = 0.1;  // square of a slope that is no distance's: midway between parts of a map
  private const double _shell = 1.5;  // lattice steps below the surface, of the points nearest to anything outside

  /// <summary>First point, base frame, m.</summary>
  public readonly Vector Origin;
  /// <summary>Between points, m.</summary>
  public readonly double Spacing;
  /// <summary>Points along the base frame's x.</summary>
  public readonly int CountX;
  /// <summary>Points along the base frame's y.</summary>
  public readonly int CountY;
  /// <summary>Points along the base frame's z.</summary>
  public readonly int CountZ;

  private readonly float[] _values;

  /// <param name="values">m, the base frame's x fastest, then z, then y: the order of the package's file, where y and z
  /// have changed places.</param>
  /// <param name="countX">Points along the base frame's x, at least 2, as along the others.</param>
  /// <param name="countY">Along y.</param>
  /// <param name="countZ">Along z.</param>
  /// <param name="origin">First point, base frame, m.</param>
  /// <param name="spacing">Between points, along all axes, m.</param>
  public SignedMap(float[] values, int countX, int countY, int countZ, Vector origin, double spacing) {
    _values = values;
    CountX = countX;
    CountY = countY;
    CountZ = countZ;
    Origin = origin;
    Spacing = spacing;
  }

  /// <summary>s at <paramref name="point"/>, m; off the lattice, the value at its border and the distance to
  /// that.</summary>
  public double At(Vector point) => Slope(point, out _);

  /// <summary>s at <paramref name="point"/>, m, and its gradient there.</summary>
  public double Slope(Vector point, out Vector slope) {
    double x = (point.X - Origin.X) / Spacing, y = (point.Y - Origin.Y) / Spacing, z = (point.Z - Origin.Z) / Spacing;
    double insideX = Math.Min(Math.Max(x, 0), CountX - 1.0);
    double insideY = Math.Min(Math.Max(y, 0), CountY - 1.0);
    double insideZ = Math.Min(Math.Max(z, 0), CountZ - 1.0);
    int i = Math.Min((int)insideX, CountX - 2), j = Math.Min((int)insideY, CountY - 2);
    int k = Math.Min((int)insideZ, CountZ - 2);
    double u = insideX - i, v = insideY - j, w = insideZ - k;
    int alongZ = CountX, alongY = CountX * CountZ, at = i + alongZ * k + alongY * j;
    double a = _values[at], b = _values[at + alongY], c = _values[at + 1], d = _values[at + alongY + 1];
    double da = _values[at + alongZ] - a, db = _values[at + alongY + alongZ] - b;
    double dc = _values[at + 1 + alongZ] - c, dd = _values[at + alongY + 1 + alongZ] - d;
    a += w * da;  // along z; then along y, then x
    b += w * db;
    c += w * dc;
    d += w * dd;
    double e = a + v * (b - a), f = c + v * (d - c);
    double up = (da + v * (db - da)) + u * ((dc + v * (dd - dc)) - (da + v * (db - da)));
    double value = e + u * (f - e), aside = (b - a) + u * ((d - c) - (b - a));
    double offX = x - insideX, offY = y - insideY, offZ = z - insideZ;
    if (offX == 0 && offY == 0 && offZ == 0) {
      slope = Scale(new Vector(f - e, aside, up), 1 / Spacing);
      return value;
    }
    double beyond = Math.Sqrt(offX * offX + offY * offY + offZ * offZ);
    slope = new Vector(
        offX != 0 ? offX / beyond : (f - e) / Spacing,
        offY != 0 ? offY / beyond : aside / Spacing,
        offZ != 0 ? offZ / beyond : up / Spacing);
    return value + Spacing * beyond;
  }

  /// <summary>The lattice points just inside of this map, and of the <paramref name="other"/> on the same lattice,
  /// where there is one.</summary>
  public NearestPoints Shell(SignedMap other = null) {
    var points = new List<double>();
    int at = 0;
    for (int j = 0; j < CountY; j++) {
      for (int k = 0; k < CountZ; k++) {
        for (int i = 0; i < CountX; i++, at++) {
          double value = other == null ? _values[at] : Math.Max(_values[at], other._values[at]);
          if (value <= 0 && value > -_shell * Spacing) {
            points.Add(Origin.X + Spacing * i);
            points.Add(Origin.Y + Spacing * j);
            points.Add(Origin.Z + Spacing * k);
          }
        }
      }
    }
    return new NearestPoints(points.ToArray());
  }

  /// <summary>Of <paramref name="point"/> by a <paramref name="signal"/>; <paramref name="points"/>: where else to look
  /// for the nearest, a shell.</summary>
  public static Reading Read(Signal signal, NearestPoints points, Vector point) {
    double outside = signal(point, out var slope);
    if (outside <= 0) {
      return new Reading(Where.Inside);
    }
    if (points.Count == 0) {
      return new Reading(Where.Outside, outside);
    }
    var aim = Projected(signal, point, outside, slope);
    // Whether any lattice point is nearer; with a bound, the tree is soon asked.
    int index = points.Query(point, aim == null ? double.PositiveInfinity : Distance(aim.Value, point));
    if (aim != null && index < 0) {
      return new Reading(Where.Outside, outside, aim);
    }
    var near = points[index];
    double inside = 0, beyond = 1;  // shares of the way from `near` to `point`
    for (int n = 0; n < _halvings; n++) {
      double half = (inside + beyond) / 2;
      if (signal(Between(near, point, half), out _) <= 0) {
        inside = half;
      } else {
        beyond = half;
      }
    }
    return new Reading(Where.Outside, outside, Between(near, point, inside));
  }

  // Where the way down the signal's gradient from `point` comes inside; null where it does not.
  private static Vector? Projected(Signal signal, Vector point, double value, Vector slope) {
    for (int n = 0; n < _projections; n++) {
      double steep = Dot(slope, slope);
      if (steep < _flat) {
        return null;
      }
      point = Subtract(point, Scale(slope, (value + _depth) / steep));
      value = signal(point, out slope);
      if (value <= 0) {
        return point;
      }
    }
    return null;
  }

  private static Vector Between(Vector a, Vector b, double share) =>
      new Vector(a.X + share * (b.X - a.X), a.Y + share * (b.Y - a.Y), a.Z + share * (b.Z - a.Z));
}
}
