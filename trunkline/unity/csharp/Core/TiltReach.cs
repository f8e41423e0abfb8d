using System;
using System.Collections.Generic;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>Reach of the tip by the maps of one tilt: grids of signed distances, linear between the gravity angles
/// beside the present one. Port of trunkline/ar/teleop/tilt_reach.py.
///
/// What no map tells is unknown: gravity that is not in the plane of a tendon, or beyond the last angle.</summary>
public sealed class TiltReach : ISoftReach {
  internal const double Symmetry = 2 * Math.PI / 3;  // three tendons alike: the maps turned by it are the maps
  internal static readonly double StraightDown = Radians(1);  // gravity angle below which gravity has no azimuth
  internal static readonly double Azimuth = Radians(5);  // by which gravity may be out of a tendon's plane

  private readonly IReadOnlyList<SignedMap> _maps;
  private readonly IReadOnlyList<double> _angles;
  private readonly NearestPoints[] _points;

  /// <param name="maps">In the soft arm's base frame, on one lattice.</param>
  /// <param name="angles">Of gravity, rad, ascending.</param>
  public TiltReach(IReadOnlyList<SignedMap> maps, IReadOnlyList<double> angles) {
    bool ascending = true;
    for (int i = 1; i < angles.Count; i++) {
      ascending &= angles[i] > angles[i - 1];
    }
    if (maps.Count != angles.Count || maps.Count < 2 || !ascending) {
      string found = string.Join(", ", new List<double>(angles).ConvertAll(one => Formats.General(one)));
      throw new InputError($"soft maps: found {maps.Count} maps at angles [{found}], expected as many, ascending");
    }
    _maps = maps;
    _angles = angles;
    _points = new NearestPoints[maps.Count - 1];
    for (int i = 0; i < _points.Length; i++) {
      _points[i] = maps[i].Shell(maps[i + 1]);
    }
  }

  /// <inheritdoc/>
  public Reading Read(Vector tip, Vector gravity) {
    double level = Hypot(gravity.X, gravity.Y), angle = Math.Atan2(level, -gravity.Z), turn = 0;
    if (angle > StraightDown) {
      double azimuth = Math.Atan2(gravity.Y, gravity.X);
      turn = Symmetry * Math.Round(azimuth / Symmetry);
      // The nearer the axis, the less its direction says: what counts is how far gravity is out of the plane.
      if (level * Math.Abs(Math.Sin(azimuth - turn)) > Math.Sin(Azimuth)) {
        return new Reading(Where.Unknown);
      }
    }
    if (angle > _angles[_angles.Count - 1]) {
      return new Reading(Where.Unknown);
    }
    int upper = 1;
    while (upper < _angles.Count - 1 && angle > _angles[upper]) {
      upper++;
    }
    SignedMap low = _maps[upper - 1], high = _maps[upper];
    double share = (angle - _angles[upper - 1]) / (_angles[upper] - _angles[upper - 1]);
    share = Math.Min(Math.Max(share, 0), 1);

    Signal signal = (Vector point, out Vector slope) => {
      double below = low.Slope(point, out var down), above = high.Slope(point, out var up);
      slope = Add(Scale(down, 1 - share), Scale(up, share));
      return below + share * (above - below);
    };
    var found = SignedMap.Read(signal, _points[upper - 1], AboutZ(tip, -turn));
    return found.Offer == null ? found : found.WithOffer(AboutZ(found.Offer.Value, turn));
  }

  private static Vector AboutZ(Vector point, double angle) {
    double c = Math.Cos(angle), s = Math.Sin(angle);
    return new Vector(c * point.X - s * point.Y, s * point.X + c * point.Y, point.Z);
  }
}
}
