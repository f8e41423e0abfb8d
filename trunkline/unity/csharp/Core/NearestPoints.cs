using System;

namespace Trunkline {

/// <summary>A k-d tree of points, in the place of scipy's cKDTree.</summary>
public sealed class NearestPoints {
  private const int _leaf = 16;  // points that are looked at one by one

  private readonly double[] _points;
  private readonly int[] _order;
  private readonly byte[] _axes;  // along which a range is halved, at its middle
  private readonly double[] _halves;  // where: no point before the middle is beyond, none from it on before

  /// <param name="points">x, y, z of each, m.</param>
  public NearestPoints(double[] points) {
    _points = points;
    _order = new int[points.Length / 3];
    for (int i = 0; i < _order.Length; i++) {
      _order[i] = i;
    }
    _axes = new byte[_order.Length];
    _halves = new double[_order.Length];
    Build(0, _order.Length);
  }

  /// <summary>How many points there are.</summary>
  public int Count => _order.Length;

  /// <summary>m, in the order in which they were given.</summary>
  public Vector this[int index] =>
      new Vector(_points[3 * index], _points[3 * index + 1], _points[3 * index + 2]);

  /// <summary>Index of the nearest point that is nearer than <paramref name="within"/>, m; -1 where there is
  /// none.</summary>
  public int Query(Vector place, double within) {
    int found = -1;
    double least = within * within;
    Search(0, _order.Length, place, ref least, ref found);
    return found;
  }

  private void Search(int first, int end, in Vector place, ref double least, ref int found) {
    if (end - first <= _leaf) {
      for (int i = first; i < end; i++) {
        int at = 3 * _order[i];
        double x = _points[at] - place.X, y = _points[at + 1] - place.Y, z = _points[at + 2] - place.Z;
        double squared = x * x + y * y + z * z;
        if (squared < least) {
          least = squared;
          found = _order[i];
        }
      }
      return;
    }
    int middle = (first + end) / 2, axis = _axes[middle];
    double own = axis == 0 ? place.X : axis == 1 ? place.Y : place.Z;
    double beyond = own - _halves[middle];
    if (beyond < 0) {
      Search(first, middle, place, ref least, ref found);
    } else {
      Search(middle, end, place, ref least, ref found);
    }
    if (beyond * beyond >= least) {
      return;
    }
    if (beyond < 0) {
      Search(middle, end, place, ref least, ref found);
    } else {
      Search(first, middle, place, ref least, ref found);
    }
  }

  private void Build(int first, int end) {
    if (end - first <= _leaf) {
      return;
    }
    int middle = (first + end) / 2, axis = Widest(first, end);
    Select(first, end - 1, middle, axis);
    _axes[middle] = (byte)axis;
    _halves[middle] = _points[3 * _order[middle] + axis];
    Build(first, middle);
    Build(middle, end);
  }

  private int Widest(int first, int end) {
    int widest = 0;
    double most = -1;
    for (int axis = 0; axis < 3; axis++) {
      double low = double.PositiveInfinity, high = double.NegativeInfinity;
      for (int i = first; i < end; i++) {
        double value = _points[3 * _order[i] + axis];
        low = Math.Min(low, value);
        high = Math.Max(high, value);
      }
      if (high - low > most) {
        most = high - low;
        widest = axis;
      }
    }
    return widest;
  }

  // Hoare's selection: what is before `middle` is not greater, what is after it not smaller.
  private void Select(int low, int high, int middle, int axis) {
    while (low < high) {
      double pivot = _points[3 * _order[(low + high) / 2] + axis];
      int i = low, j = high;
      while (i <= j) {
        while (_points[3 * _order[i] + axis] < pivot) {
          i++;
        }
        while (_points[3 * _order[j] + axis] > pivot) {
          j--;
        }
        if (i <= j) {
          int kept = _order[i];
          _order[i++] = _order[j];
          _order[j--] = kept;
        }
      }
      if (middle <= j) {
        high = j;
      } else if (middle >= i) {
        low = i;
      } else {
        return;
      }
    }
  }
}
}
