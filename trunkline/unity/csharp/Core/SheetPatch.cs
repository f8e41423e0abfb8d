using System;
using System.Collections.Generic;

namespace Trunkline {

/// <summary>A part of a sheet's lattice between two ways around the arm and two places along the tip's way, and the
/// quarters of it, down to single cells. Its two triangles between its corners stand in for all triangles in it:
/// <see cref="SheetReach"/> has the bound by which these may be off.</summary>
internal sealed class SheetPatch {
  /// <summary>Directions of gravity, one after the other, whose bounds are one: the greatest.</summary>
  public const int Group = 10;

  /// <summary>Points at its corners: first way and first place, first way and last place, last and last, last and
  /// first.</summary>
  public readonly int A, B, C, D;
  /// <summary>By group of directions of gravity: how far any of its points is at most from the bilinear surface between
  /// its corners, m.</summary>
  public readonly double[] Off;
  /// <summary>Of its twist |a - b + c - d|: how far triangles in the bilinear surface are off its own at most.</summary>
  public readonly double Bent;
  /// <summary>Its quarters; null of a cell, whose triangles are the surface's own.</summary>
  public readonly SheetPatch[] Parts;

  /// <summary>How far its triangles may be off, m.</summary>
  public double Slack;
  /// <summary>Under which gravity that is, counted.</summary>
  public int Known;

  public static int GroupsOf(int directions) => (directions + Group - 1) / Group;

  private SheetPatch(SheetPatch[] parts) {
    Parts = parts;
  }

  private SheetPatch(Lattice lattice, int ray, int rayEnd, int step, int stepEnd) {
    A = lattice.At(ray, step);
    B = lattice.At(ray, stepEnd);
    C = lattice.At(rayEnd, stepEnd);
    D = lattice.At(rayEnd, step);
    if (rayEnd - ray == 1 && stepEnd - step == 1) {
      return;
    }
    Bent = 0.25 + 0.25 / ((rayEnd - ray) * (stepEnd - step));
    Off = lattice.Off(this, ray, rayEnd, step, stepEnd);
    Parts = Tiles(lattice, ray, rayEnd, step, stepEnd, (rayEnd - ray + 1) / 2, (stepEnd - step + 1) / 2);
  }

  /// <summary>The whole sheet, in tiles of <paramref name="side"/> cells at most along each side.</summary>
  /// <param name="points">m: x, y, z of a point under each direction, then of the next point.</param>
  /// <param name="count">Of directions.</param>
  /// <param name="around">Ways around the arm.</param>
  /// <param name="along">Points of each.</param>
  /// <param name="side">Cells.</param>
  public static SheetPatch Whole(float[] points, int count, int around, int along, int side) =>
      new SheetPatch(Tiles(new Lattice(points, count, around, along), 0, around, 0, along - 1, side, side));

  private static SheetPatch[] Tiles(Lattice lattice, int ray, int rayEnd, int step, int stepEnd, int wide, int high) {
    var found = new List<SheetPatch>();
    for (int r = ray; r < rayEnd; r += wide) {
      for (int s = step; s < stepEnd; s += high) {
        found.Add(new SheetPatch(lattice, r, Math.Min(r + wide, rayEnd), s, Math.Min(s + high, stepEnd)));
      }
    }
    return found.ToArray();
  }

  private sealed class Lattice {
    private readonly float[] _points;
    private readonly int _count, _around, _along;

    public Lattice(float[] points, int count, int around, int along) {
      _points = points;
      _count = count;
      _around = around;
      _along = along;
    }

    public int At(int ray, int step) => ray % _around * _along + step;

    public double[] Off(SheetPatch patch, int ray, int rayEnd, int step, int stepEnd) {
      var most = new double[GroupsOf(_count)];
      for (int r = ray; r <= rayEnd; r++) {
        for (int s = step; s <= stepEnd; s++) {
          double beside = (double)(r - ray) / (rayEnd - ray), on = (double)(s - step) / (stepEnd - step);
          double a = (1 - beside) * (1 - on), b = (1 - beside) * on, c = beside * on, d = beside * (1 - on);
          for (int j = 0; j < _count; j++) {
            double squared = 0;
            for (int axis = 0; axis < 3; axis++) {
              double off = Of(At(r, s), j, axis) - a * Of(patch.A, j, axis) - b * Of(patch.B, j, axis)
                  - c * Of(patch.C, j, axis) - d * Of(patch.D, j, axis);
              squared += off * off;
            }
            most[j / Group] = Math.Max(most[j / Group], Math.Sqrt(squared));
          }
        }
      }
      return most;
    }

    private double Of(int point, int direction, int axis) => _points[3 * (point * _count + direction) + axis];
  }
}
}
