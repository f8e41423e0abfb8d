using System;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>The One-Euro filter, a low-pass whose cutoff grows with speed: trunkline/ar/teleop/one_euro.py, which has the
/// equations and their source.</summary>
public sealed class OneEuro {
  /// <summary>Hz: the paper's f_min.</summary>
  public readonly double MinCutoff;
  /// <summary>Hz per m/s, of orientations per rad/s: the paper's β.</summary>
  public readonly double Beta;
  /// <summary>Hz: the paper's f_d.</summary>
  public readonly double DerivativeCutoff;

  /// <summary>As the fields of the same names.</summary>
  public OneEuro(double minCutoff, double beta, double derivativeCutoff) {
    MinCutoff = minCutoff;
    Beta = beta;
    DerivativeCutoff = derivativeCutoff;
  }

  /// <summary>The filtered pose after a measured one, <paramref name="dt"/> s after the <paramref name="last"/>; as
  /// measured where there is no last one.</summary>
  public static Smoothed Smooth(Smoothed last, Vector position, Quaternion quaternion, double dt, OneEuro place,
                                OneEuro turn) {
    quaternion = Unit(quaternion);
    if (last == null) {
      return new Smoothed(position, quaternion, new Vector(), 0);
    }
    var moved = Scale(Subtract(position, last.Position), 1 / dt);
    double share = Share(place.DerivativeCutoff, dt);
    var velocity = Add(last.Velocity, Scale(Subtract(moved, last.Velocity), share));
    share = Share(place.MinCutoff + place.Beta * Norm(velocity), dt);
    var placed = Add(last.Position, Scale(Subtract(position, last.Position), share));
    double turned = AngleBetween(last.Quaternion, quaternion) / dt;
    double spin = last.Spin + Share(turn.DerivativeCutoff, dt) * (turned - last.Spin);
    share = Share(turn.MinCutoff + turn.Beta * Math.Abs(spin), dt);
    return new Smoothed(placed, Toward(last.Quaternion, quaternion, share), velocity, spin);
  }

  private static double Share(double cutoff, double dt) => 1 / (1 + 1 / (2 * Math.PI * cutoff * dt));
}

/// <summary>A pose as filtered: position (m) and quaternion, their low-passed velocity (m/s) and spin
/// (rad/s).</summary>
public sealed class Smoothed {
  /// <summary>Reference frame, m.</summary>
  public readonly Vector Position;
  /// <summary>Reference frame, m/s.</summary>
  public readonly Vector Velocity;
  /// <summary>Unit length, from the controller's axes to the reference frame's.</summary>
  public readonly Quaternion Quaternion;
  /// <summary>rad/s, not negative: how fast it turns, about whatever axis.</summary>
  public readonly double Spin;

  /// <summary>As the fields of the same names.</summary>
  public Smoothed(Vector position, Quaternion quaternion, Vector velocity, double spin) {
    Position = position;
    Quaternion = quaternion;
    Velocity = velocity;
    Spin = spin;
  }
}
}
