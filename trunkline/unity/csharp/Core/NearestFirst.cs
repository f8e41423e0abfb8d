using System;

namespace Trunkline {

/// <summary>Patches that are still to be looked into, the nearest first: a binary heap.</summary>
internal sealed class NearestFirst {
  private SheetPatch[] _patches = new SheetPatch[64];
  private double[] _away = new double[64];
  private int _count;

  public void Clear() => _count = 0;

  public void Add(SheetPatch patch, double away) {
    if (_count == _away.Length) {
      Array.Resize(ref _patches, 2 * _count);
      Array.Resize(ref _away, 2 * _count);
    }
    int at = _count++;
    for (int above = (at - 1) / 2; at > 0 && away < _away[above]; at = above, above = (at - 1) / 2) {
      Move(above, at);
    }
    _patches[at] = patch;
    _away[at] = away;
  }

  /// <summary>How far the nearest is away, m; NaN, which is not below any bound, where none is left.</summary>
  public double Take(out SheetPatch patch) {
    patch = _patches[0];
    if (_count == 0) {
      return double.NaN;
    }
    double nearest = _away[0], away = _away[--_count];
    int at = 0;
    for (int below = 1; below < _count; below = 2 * at + 1) {
      below += below + 1 < _count && _away[below + 1] < _away[below] ? 1 : 0;
      if (_away[below] >= away) {
        break;
      }
      Move(below, at);
      at = below;
    }
    _patches[at] = _patches[_count];
    _away[at] = away;
    return nearest;
  }

  private void Move(int from, int to) {
    _patches[to] = _patches[from];
    _away[to] = _away[from];
  }
}
}
