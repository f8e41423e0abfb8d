using System;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>Reach of the tip by sheets, under gravity from any side: trunkline/teleop/sheet_reach.py.
///
/// With points p_j of the surface of tips under gravity g_j, under gravity g they are Σ w_j p_j. The nearest point of
/// all triangles between them is the nearest that the tip reaches. Gravity further from straight down than any of the
/// directions that are known is unknown. The surface of the last gravity is kept; ask from one thread.</summary>
public sealed class SheetReach : ISoftReach {
  private const double _rounding = 1e-6;  // of a unit vector, by which gravity may be beyond the last directions
  private const int _side = 4;  // cells along each side of a block, whose box says whether to look at its triangles

  private readonly float[] _points;
  private readonly Vector[] _downs;
  private readonly double[] _matrix, _terms, _sheet, _boxes;
  private readonly int _around, _along, _blocksAround, _blocksAlong;
  private readonly double _tolerance, _lowest;
  private Vector _last;

  /// <param name="points">m, x, y, z of each, by direction, way around the arm, place along the tip's way, in the soft
  /// arm's base frame.</param>
  /// <param name="downs">Directions of gravity, unit vectors, D of them.</param>
  /// <param name="matrix">Of the weights, D rows of D + 4.</param>
  /// <param name="around">Ways around the arm.</param>
  /// <param name="along">Places along the tip's way.</param>
  /// <param name="tolerance">m.</param>
  public SheetReach(float[] points, Vector[] downs, double[] matrix, int around, int along, double tolerance) {
    int count = downs.Length;
    if (points.Length != count * around * along * 3 || matrix.Length != count * (count + 4)) {
      throw new InputError($"sheets: found points, directions and matrix of {points.Length}, ({count}, 3), "
          + $"{matrix.Length} numbers, expected (D, R, S, 3), (D, 3) and (D, D + 4)");
    }
    _points = points;
    _downs = downs;
    _matrix = matrix;
    _around = around;
    _along = along;
    _tolerance = tolerance;
    _terms = new double[count + 4];
    _sheet = new double[3 * around * along];
    _blocksAround = (around + _side - 1) / _side;
    _blocksAlong = (along - 1 + _side - 1) / _side;
    _boxes = new double[6 * _blocksAround * _blocksAlong];
    double highest = double.NegativeInfinity;
    foreach (var down in downs) {
      highest = Math.Max(highest, down.Z);
    }
    _lowest = -highest - _rounding;
    SetGravity(Down);
  }

  /// <inheritdoc/>
  public Reading Read(Vector tip, Vector gravity) {
    if (-gravity.Z < _lowest) {
      return new Reading(Where.Unknown);
    }
    if (gravity != _last) {  // gravity mostly stands still
      SetGravity(gravity);
    }
    double outside = Math.Sqrt(Nearest(tip, out var nearest)) - _tolerance;
    return outside <= 0 ? new Reading(Where.Inside) : new Reading(Where.Outside, outside, nearest);
  }

  // The surface under `gravity`, and the box of each of its blocks.
  private void SetGravity(Vector gravity) {
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
    Array.Clear(_sheet, 0, _sheet.Length);
    int size = _sheet.Length, first = 0;
    for (; first + 4 <= count; first += 4) {  // four at once: each sum in the same order, with a quarter of the stores
      double a = Weight(first), b = Weight(first + 1), c = Weight(first + 2), d = Weight(first + 3);
      for (int i = 0, at = first * size; i < size; i++, at++) {
        _sheet[i] = _sheet[i] + a * _points[at] + b * _points[at + size] + c * _points[at + 2 * size]
            + d * _points[at + 3 * size];
      }
    }
    for (; first < count; first++) {
      double weight = Weight(first);
      for (int i = 0; i < size; i++) {
        _sheet[i] += weight * _points[first * size + i];
      }
    }
    for (int block = 0; block < _blocksAround * _blocksAlong; block++) {
      Enclose(block);
    }
    _last = gravity;
  }

  private double Weight(int direction) {
    double weight = 0;
    int row = direction * _terms.Length;
    for (int k = 0; k < _terms.Length; k++) {
      weight += _matrix[row + k] * _terms[k];
    }
    return weight;
  }

  // The cells of a block: ways around the arm from `ray` to before `rayEnd`, places from `step` to before `stepEnd`.
  private void Cells(int block, out int ray, out int rayEnd, out int step, out int stepEnd) {
    ray = block / _blocksAlong * _side;
    rayEnd = Math.Min(ray + _side, _around);
    step = block % _blocksAlong * _side;
    stepEnd = Math.Min(step + _side, _along - 1);
  }

  private void Enclose(int block) {
    Cells(block, out int ray, out int rayEnd, out int step, out int stepEnd);
    for (int axis = 0; axis < 3; axis++) {
      double low = double.PositiveInfinity, high = double.NegativeInfinity;
      for (int r = ray; r <= rayEnd; r++) {
        for (int s = step; s <= stepEnd; s++) {
          double value = _sheet[3 * (r % _around * _along + s) + axis];
          low = Math.Min(low, value);
          high = Math.Max(high, value);
        }
      }
      _boxes[6 * block + axis] = low;
      _boxes[6 * block + 3 + axis] = high;
    }
  }

  private double ToBox(int block, Vector tip) {
    int at = 6 * block;
    double x = Math.Max(Math.Max(_boxes[at] - tip.X, tip.X - _boxes[at + 3]), 0);
    double y = Math.Max(Math.Max(_boxes[at + 1] - tip.Y, tip.Y - _boxes[at + 4]), 0);
    double z = Math.Max(Math.Max(_boxes[at + 2] - tip.Z, tip.Z - _boxes[at + 5]), 0);
    return x * x + y * y + z * z;
  }

  // Square of the distance to the nearest point of all triangles, and that point: those of the block whose box is
  // nearest first, then of all whose box is nearer than what was found.
  private double Nearest(Vector tip, out Vector nearest) {
    int first = 0, blocks = _blocksAround * _blocksAlong;
    double least = double.PositiveInfinity, best = double.PositiveInfinity;
    for (int block = 0; block < blocks; block++) {
      double away = ToBox(block, tip);
      if (away < least) {
        least = away;
        first = block;
      }
    }
    nearest = new Vector();
    OfBlock(first, tip, ref best, ref nearest);
    for (int block = 0; block < blocks; block++) {
      if (block != first && ToBox(block, tip) < best) {
        OfBlock(block, tip, ref best, ref nearest);
      }
    }
    return best;
  }

  private void OfBlock(int block, in Vector tip, ref double best, ref Vector nearest) {
    Cells(block, out int ray, out int rayEnd, out int step, out int stepEnd);
    for (int r = ray; r < rayEnd; r++) {
      int here = r * _along, beside = (r + 1) % _around * _along;
      for (int s = step; s < stepEnd; s++) {
        OfTriangle(here + s, here + s + 1, beside + s + 1, tip, ref best, ref nearest);
        OfTriangle(here + s, beside + s + 1, beside + s, tip, ref best, ref nearest);
      }
    }
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
