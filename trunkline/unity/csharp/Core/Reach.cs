using System;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>What tells whether targets can be reached: trunkline/ar/teleop/reach.py.</summary>
public interface IReach {
  /// <summary>Of the mount at <paramref name="mount"/>, m, the end effector pointing along a unit vector, both in the
  /// rigid base frame.</summary>
  Reading Rigid(Vector mount, Vector pointing);

  /// <summary>Of the tip at <paramref name="tip"/>, m, under gravity along a unit vector, both in the soft arm's base
  /// frame.</summary>
  Reading Soft(Vector tip, Vector gravity);
}

/// <summary>Maps of the tip's reach: <see cref="SheetReach"/> or <see cref="TiltReach"/>.</summary>
public interface ISoftReach {
  /// <summary>As <see cref="IReach.Soft"/>.</summary>
  Reading Read(Vector tip, Vector gravity);
}

/// <summary>The mount's reach by the map for an end effector straight down, unknown elsewhere; the tip's under gravity
/// from any side, or of one tilt, as the package has it.</summary>
public sealed class MapReach : IReach {
  private static readonly double _tilt = Radians(1);  // by which the mount may be off straight down

  private readonly Signal _rigid;
  private readonly NearestPoints _rigidPoints;
  private readonly ISoftReach _soft;

  /// <param name="rigid">In the rigid base frame.</param>
  /// <param name="soft">In the soft arm's.</param>
  public MapReach(SignedMap rigid, ISoftReach soft) {
    _rigid = rigid.Slope;
    _rigidPoints = rigid.Shell();
    _soft = soft;
  }

  /// <inheritdoc/>
  /// <exception cref="InputError">The target is not a number.</exception>
  public Reading Rigid(Vector mount, Vector pointing) {
    Require("mount", mount);
    return Dot(pointing, Down) < Math.Cos(_tilt) ? new Reading(Where.Unknown)
        : SignedMap.Read(_rigid, _rigidPoints, mount);
  }

  /// <inheritdoc/>
  /// <exception cref="InputError">The target or gravity is not a number.</exception>
  public Reading Soft(Vector tip, Vector gravity) {
    Require("tip", tip);
    Require("gravity", gravity);
    return _soft.Read(tip, gravity);
  }

  internal static void Require(string name, Vector given) {
    if (!IsFinite(given)) {
      throw new InputError($"{name}: found ({Formats.General(given.X)}, {Formats.General(given.Y)}, "
          + $"{Formats.General(given.Z)}), expected finite numbers");
    }
  }
}
}
