using System;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>Reach of the tip by sheets, under gravity from any side: trunkline/ar/teleop/surface_reach.py.
///
/// With points p_j of the surface of tips under gravity g_j, under gravity g they are Σ w_j p_j. The nearest point of
/// all triangles between them is the nearest that the tip reaches. Gravity further from straight down than any of the
/// directions that are known is unknown.
///
/// Few points are summed. The surface is quartered again and again into patches, and one that cannot be nearer than
/// what was found is left out; the answer is that of the whole surface. Of a patch with the corners a, b, c, d, points
/// are off the bilinear surface between them by Σ |w_j| off_j at most, off_j those of p_j. Triangles between such
/// points are off a b c and a c d by (1/4 + 1/4n) |a - b + c - d| more in a patch of n cells: by min(x, y) - x y for the
/// triangles, and by their covariance for those of the cells. Sums under the last gravity are kept; ask from one
/// thread.</summary>
public sealed class SheetReach : ISoftReach {
  private const double _beyond = 1e-6;  // of a unit vector, by which gravity may be beyond the last directions
  private const double _rounding = 1e-12;  // m, of distances
  private const int _side = 8;  // cells along each side of the largest patches

  private readonly float[] _points;  // x, y, z of a point under each direction, then of the next point
  private readonly Vector[] _downs;
  private readonly double[] _matrix, _terms, _weights, _sizes, _sheet;
  private readonly int[] _summed;  // by point: under which gravity, counted
  private readonly SheetPatch _whole;
  private readonly NearestFirst _open = new NearestFirst();
  private readonly double _tolerance, _lowest;
  private Vector _last, _nearest;
  private int _gravity;
  private double _best, _bound;  // of the tip that is asked about: square of the least distance, and a bound of it, m

  /// <param name="points">m, x, y, z of each, by direction, way around the arm, place along the tip's way, in the soft
  /// arm's base frame.</param>
  /// <param name="downs">Directions of gravity, unit vectors, D of them.</param>
  /// <param name="matrix">Of the weights, D rows of D + 4.</param>
  /// <param name="around">Ways around the arm.</param>
  /// <param name="along">Places along the tip's way.</param>
  /// <param name="tolerance">m.</param>
  public SheetReach(float[] points, Vector[] downs, double[] matrix, int around, int along, double tolerance) {
    int count = downs.Length, size = 3 * around * along;
    if (points.Length != count * size || matrix.Length != count * (count + 4)) {
      throw new InputError($"sheets: found points, directions and matrix of {points.Length}, ({count}, 3), "
          + $"{matrix.Length} numbers, expected (D, R, S, 3), (D, 3) and (D, D + 4)");
    }
    _points = new float[points.Length];
    for (int j = 0; j < count; j++) {
      for (int i = 0; i < size; i++) {
        _points[3 * (i / 3 * count + j) + i % 3] = points[j * size + i];
      }
    }
    _downs = downs;
    _matrix = matrix;
    _tolerance = tolerance;
    _terms = new double[count + 4];
    _weights = new double[count];
    _sizes = new double[SheetPatch.GroupsOf(count)];
    _sheet = new double[size];
    _summed = new int[around * along];
    _whole = SheetPatch.Whole(_points, count, around, along, _side);
    double highest = double.NegativeInfinity;
    foreach (var down in downs) {
      highest = Math.Max(highest, down.Z);
    }
    _lowest = -highest - _beyond;
    SetGravity(Down);
  }

  /// <inheritdoc/>
  public Reading Read(Vector tip, Vector gravity) {
    if (!Knows(gravity)) {
      return new Reading(Where.Unknown);
    }
    double outside = Search(tip, gravity, _tolerance);
    return outside <= 0 ? new Reading(Where.Inside) : new Reading(Where.Outside, outside, _nearest);
  }

  /// <summary>Whether gravity along this unit vector is no further from straight down than the directions that are
  /// known.</summary>
  public bool Knows(Vector gravity) => -gravity.Z >= _lowest;

  /// <summary>How far <paramref name="tip"/> is from the surface under <paramref name="gravity"/>, less the tolerance,
  /// m: above 0 it is out of reach. And the nearest point of the surface, also where it is within.</summary>
  /// <exception cref="InputError">The tip or gravity is not a number.</exception>
  public double Signal(Vector tip, Vector gravity, out Vector nearest) {
    MapReach.Require("tip", tip);
    MapReach.Require("gravity", gravity);
    double outside = Search(tip, gravity, 0);
    nearest = _nearest;
    return outside;
  }

  /// <summary>All points of the surface under <paramref name="gravity"/>, m, one way around the arm after the
  /// other.</summary>
  public Vector[] Surface(Vector gravity) {
    SetGravity(gravity);
    var found = new Vector[_summed.Length];
    for (int i = 0; i < found.Length; i++) {
      Sum(i);
      found[i] = new Vector(_sheet[3 * i], _sheet[3 * i + 1], _sheet[3 * i + 2]);
    }
    return found;
  }

  private void SetGravity(Vector gravity) {
    if (gravity == _last) {  // it mostly stands still
      return;
    }
    int count = _downs.Length;
    for (int j = 0; j < count; j++) {
      var apart = Subtract(gravity, _downs[j]);
      double squared = Dot(apart, apart);
      _terms[j] = squared * Math.Sqrt(squared);
    }
    _terms[count] = 1;
    _terms[count + 1] = gravity.X;
    _terms[count + 2] = gravity.Y;
    _terms[count + 3] = gravity.Z;
    Weigh();
    Array.Clear(_sizes, 0, _sizes.Length);
    for (int j = 0; j < count; j++) {
      _sizes[j / SheetPatch.Group] += Math.Abs(_weights[j]);
    }
    _last = gravity;
    _gravity++;
  }

  // M times the terms, of which eight stay at hand for all rows: half the time of a row after the other.
  private void Weigh() {
    double[] matrix = _matrix, terms = _terms, weights = _weights;  // locals: half the time again
    int rows = weights.Length, columns = terms.Length, k = 0;
    Array.Clear(weights, 0, rows);
    for (; k + 8 <= columns; k += 8) {
      double a = terms[k], b = terms[k + 1], c = terms[k + 2], d = terms[k + 3];
      double e = terms[k + 4], f = terms[k + 5], g = terms[k + 6], h = terms[k + 7];
      for (int j = 0, at = k; j < rows; j++, at += columns) {
        weights[j] += matrix[at] * a + matrix[at + 1] * b + matrix[at + 2] * c + matrix[at + 3] * d
            + (matrix[at + 4] * e + matrix[at + 5] * f + matrix[at + 6] * g + matrix[at + 7] * h);
      }
    }
    for (; k < columns; k++) {
      for (int j = 0; j < rows; j++) {
        weights[j] += matrix[j * columns + k] * terms[k];
      }
    }
  }

  // As `Signal`, the nearest point in `_nearest`; a point nearer than `enough`, m, need not be the nearest.
  private double Search(Vector tip, Vector gravity, double enough) {
    SetGravity(gravity);
    _best = _bound = double.PositiveInfinity;
    _open.Clear();
    var patch = _whole;
    do {
      foreach (var part in patch.Parts) {
        double away = Away(part, tip);
        if (away <= _bound) {
          _open.Add(part, away);
        }
      }
    } while (_best > enough * enough && _open.Take(out patch) <= _bound);
    return Math.Sqrt(_best) - _tolerance;
  }

  // The least that a patch's points may be away from the tip, m; the triangles of a cell are looked at at once.
  private double Away(SheetPatch patch, in Vector tip) {
    Sum(patch.A);
    Sum(patch.B);
    Sum(patch.C);
    Sum(patch.D);
    double squared = double.PositiveInfinity;
    var point = new Vector();
    OfTriangle(patch.A, patch.B, patch.C, tip, ref squared, ref point);
    OfTriangle(patch.A, patch.C, patch.D, tip, ref squared, ref point);
    double away = Math.Sqrt(squared);
    if (patch.Parts == null) {
      if (squared < _best) {
        _best = squared;
        _nearest = point;
        _bound = Math.Min(_bound, away);
      }
      return double.PositiveInfinity;
    }
    if (patch.Known != _gravity) {
      patch.Known = _gravity;
      double[] sizes = _sizes, offs = patch.Off;
      double off = 0;
      for (int group = 0; group < offs.Length; group++) {
        off += sizes[group] * offs[group];
      }
      patch.Slack = off + patch.Bent * Twist(patch) + _rounding;
    }
    _bound = Math.Min(_bound, away + patch.Slack);
    return away - patch.Slack;
  }

  // |a - b + c - d|, m: 0 where the corners lie in a plane, as those of a parallelogram.
  private double Twist(SheetPatch patch) {
    double squared = 0;
    for (int axis = 0; axis < 3; axis++) {
      double off = _sheet[3 * patch.A + axis] - _sheet[3 * patch.B + axis] + _sheet[3 * patch.C + axis]
          - _sheet[3 * patch.D + axis];
      squared += off * off;
    }
    return Math.Sqrt(squared);
  }

  // The place of a point under the gravity that was set.
  private void Sum(int point) {
    if (_summed[point] == _gravity) {
      return;
    }
    _summed[point] = _gravity;
    var weights = _weights;
    var points = _points;
    double x = 0, y = 0, z = 0;
    int j = 0, at = 3 * point * weights.Length;
    for (; j + 4 <= weights.Length; j += 4, at += 12) {
      double a = weights[j], b = weights[j + 1], c = weights[j + 2], d = weights[j + 3];
      x += a * points[at] + b * points[at + 3] + c * points[at + 6] + d * points[at + 9];
      y += a * points[at + 1] + b * points[at + 4] + c * points[at + 7] + d * points[at + 10];
      z += a * points[at + 2] + b * points[at + 5] + c * points[at + 8] + d * points[at + 11];
    }
    for (; j < weights.Length; j++, at += 3) {
      x += weights[j] * points[at];
      y += weights[j] * points[at + 1];
      z += weights[j] * points[at + 2];
    }
    _sheet[3 * point] = x;
    _sheet[3 * point + 1] = y;
    _sheet[3 * point + 2] = z;
  }

  // Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
  private void OfTriangle(int i, int j, int k, in Vector tip, ref double best, ref Vector nearest) {
    double ax = _sheet[3 * i], ay = _sheet[3 * i + 1], az = _sheet[3 * i + 2];
    double bx = _sheet[3 * j] - ax, by = _sheet[3 * j + 1] - ay, bz = _sheet[3 * j + 2] - az;
    double cx = _sheet[3 * k] - ax, cy = _sheet[3 * k + 1] - ay, cz = _sheet[3 * k + 2] - az;
    double px = tip.X - ax, py = tip.Y - ay, pz = tip.Z - az;
    double bb = bx * bx + by * by + bz * bz, bc = bx * cx + by * cy + bz * cz, cc = cx * cx + cy * cy + cz * cz;
    double d1 = bx * px + by * py + bz * pz, d2 = cx * px + cy * py + cz * pz;
    double d3 = d1 - bb, d4 = d2 - bc, d5 = d1 - bc, d6 = d2 - cc;
    double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
    double v, w;
    if (d1 <= 0 && d2 <= 0) {
      v = 0;
      w = 0;
    } else if (d3 >= 0 && d4 <= d3) {
      v = 1;
      w = 0;
    } else if (d6 >= 0 && d5 <= d6) {
      v = 0;
      w = 1;
    } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
      v = d1 / (d1 - d3);
      w = 0;
    } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
      v = 0;
      w = d2 / (d2 - d6);
    } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
      w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
      v = 1 - w;
    } else {
      v = vb / (va + vb + vc);
      w = vc / (va + vb + vc);
    }
    double fx = v * bx + w * cx, fy = v * by + w * cy, fz = v * bz + w * cz;
    double ex = px - fx, ey = py - fy, ez = pz - fz, squared = ex * ex + ey * ey + ez * ez;
    if (squared < best) {
      best = squared;
      nearest = new Vector(ax + fx, ay + fy, az + fz);
    }
  }
}
}
