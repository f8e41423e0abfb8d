using System;
using System.Collections.Generic;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>The mount as the joints hold it: position (m) and pointing in the base frame, heading and angle of joint 7
/// (rad).</summary>
public readonly struct Wrist {
  /// <summary>Rigid base frame, m.</summary>
  public readonly Vector Position;
  /// <summary>Direction in the rigid base frame, unit length.</summary>
  public readonly Vector Pointing;
  /// <summary>rad, of the soft arm's tendon 1 about its axis.</summary>
  public readonly double Heading;
  /// <summary>rad, of joint 7.</summary>
  public readonly double Angle;

  /// <summary>As the fields of the same names.</summary>
  public Wrist(Vector position, Vector pointing, double heading, double angle) {
    Position = position;
    Pointing = pointing;
    Heading = heading;
    Angle = angle;
  }
}

/// <summary>Heading (rad) that brings the target into the half-plane of that number, and by which the wrist is turned
/// for it, rad; null where no half-plane is within the wrist's limits.</summary>
public readonly struct Aligned {
  /// <summary>rad, from -π to less than π: of tendon 1 about the arm's axis.</summary>
  public readonly double Heading;
  /// <summary>Its number in <see cref="BendingPlane.HalfPlanes"/>.</summary>
  public readonly int HalfPlane;
  /// <summary>rad, from where the wrist is; null where no half-plane is within its limits.</summary>
  public readonly double? Turned;

  /// <summary>As the fields of the same names.</summary>
  public Aligned(double heading, int halfPlane, double? turned) {
    Heading = heading;
    HalfPlane = halfPlane;
    Turned = turned;
  }
}

/// <summary>Bending-plane alignment: the wrist turns so that the tip target lies in a plane in which the arm bends.
/// Port of trunkline/ar/teleop/alignment.py, which has the equations.</summary>
public static class Alignment {
  private static readonly Vector _x = new Vector(1, 0, 0), _z = new Vector(0, 0, 1);

  /// <summary>Of the soft arm's base frame in the rigid base's: -z along <paramref name="pointing"/>, turned about z by
  /// <paramref name="heading"/>, rad.</summary>
  public static Quaternion BaseQuaternion(Vector pointing, double heading) =>
      Multiply(LeastRotation(Down, pointing), About(_z, heading));

  /// <summary>Of the soft arm's base frame in the flange's: half a turn about x.</summary>
  public static Quaternion FlangeTurn() => About(_x, Math.PI);

  /// <summary>Forward kinematics of the Panda's seven <paramref name="joints"/>, rad; the mount is
  /// <paramref name="mountOffset"/> m from the flange.</summary>
  public static Wrist WristOf(IReadOnlyList<double> joints, double mountOffset) {
    var position = new Vector(0, 0, 0);
    var turn = Identity;
    for (int i = 0; i < Panda.A.Length; i++) {
      position = Add(position, Rotate(turn, new Vector(Panda.A[i], 0, 0)));
      turn = Multiply(turn, About(_x, Panda.Alpha[i]));
      position = Add(position, Rotate(turn, new Vector(0, 0, Panda.D[i])));
      turn = Multiply(turn, About(_z, joints[i]));
    }
    var pointing = Rotate(turn, _z);
    position = Add(position, Scale(pointing, Panda.Flange + mountOffset));
    return new Wrist(position, pointing, HeadingOf(pointing, Multiply(turn, FlangeTurn())), joints[6]);
  }

  /// <summary>The heading of a soft arm whose base frame is turned by <paramref name="armBase"/>, rad.</summary>
  public static double HeadingOf(Vector pointing, Quaternion armBase) {
    if (pointing.Z > 1 - 1e-9) {  // straight up: any least rotation would do
      return 0;
    }
    var x = Rotate(Conjugate(LeastRotation(Down, pointing)), Rotate(armBase, _x));
    return Math.Atan2(x.Y, x.X);
  }

  /// <summary>The heading for a tip target when the mount is at <paramref name="mount"/>; both in m, rigid base
  /// frame.</summary>
  public static Aligned Align(Vector tip, Vector mount, Vector pointing, Wrist wrist, Aligned last,
                              BendingPlane settings) {
    var away = Rotate(Conjugate(LeastRotation(Down, pointing)), Subtract(tip, mount));
    if (Hypot(away.X, away.Y) < settings.Axis) {
      return last;
    }
    double present = CarriedHeading(mount, wrist), azimuth = Math.Atan2(away.Y, away.X);
    int best = -1;
    double least = 0;
    double? kept = null;
    for (int i = 0; i < settings.HalfPlanes.Count; i++) {
      double? turn = LeastTurn(Wrapped(azimuth - settings.HalfPlanes[i] - present), wrist.Angle);
      if (turn == null) {
        continue;
      }
      if (best < 0 || Math.Abs(turn.Value) < Math.Abs(least)) {
        best = i;
        least = turn.Value;
      }
      kept = i == last.HalfPlane ? turn : kept;
    }
    if (best < 0) {
      return new Aligned(last.Heading, last.HalfPlane, null);
    }
    if (kept != null && Math.Abs(kept.Value) <= Math.Abs(least) + settings.Hysteresis) {
      best = last.HalfPlane;
      least = kept.Value;
    }
    return new Aligned(Wrapped(azimuth - settings.HalfPlanes[best]), best, least);
  }

  /// <summary>The heading, rad, that the arm has when joint 1 has carried the wrist around the base to the mount at
  /// <paramref name="mount"/>, m.</summary>
  public static double CarriedHeading(Vector mount, Wrist wrist) {
    double carried = Math.Atan2(mount.Y, mount.X) - Math.Atan2(wrist.Position.Y, wrist.Position.X);
    return Wrapped(wrist.Heading + carried);
  }

  /// <summary><paramref name="turn"/>, or whole turns more or less, the least for which joint 7 at
  /// <paramref name="angle"/> stays within its limits; all in rad. Null where none does.</summary>
  public static double? LeastTurn(double turn, double angle) {
    double? least = null;
    for (int n = 0; n < 3; n++) {
      double t = n == 0 ? turn : n == 1 ? turn - 2 * Math.PI : turn + 2 * Math.PI;
      bool able = Panda.WristLeast <= angle - t && angle - t <= Panda.WristMost;
      if (able && (least == null || Math.Abs(t) < Math.Abs(least.Value))) {
        least = t;
      }
    }
    return least;
  }
}
}
