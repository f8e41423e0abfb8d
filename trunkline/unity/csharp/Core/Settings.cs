using System.Collections.Generic;

namespace Trunkline {

// What the core is set by: trunkline/ar/teleop/settings.py, and conf/shared/core/two_rays.yaml in the repository for what
// each number means to a user. A package's Tests/Vectors/steps.json has those that its vectors were made with.

/// <summary>Length of the rays, m, and its rate at full deflection, m/s; dead zone of the stick, share of its
/// way.</summary>
public sealed class Rays {
  /// <summary>Length of a ray at the start, m.</summary>
  public readonly double Start;
  /// <summary>The least length, m.</summary>
  public readonly double Shortest;
  /// <summary>The greatest length, m.</summary>
  public readonly double Longest;
  /// <summary>m/s.</summary>
  public readonly double Rate;
  /// <summary>0 to 1.</summary>
  public readonly double DeadZone;

  /// <summary>As the fields of the same names.</summary>
  /// <exception cref="InputError">The length at the start is not between the others.</exception>
  public Rays(double start, double shortest, double longest, double rate, double deadZone) {
    if (!(shortest <= start && start <= longest)) {
      throw new InputError($"rays.start: found {Formats.General(start)}, expected from shortest "
          + $"{Formats.General(shortest)} to {Formats.General(longest)}");
    }
    Start = start;
    Shortest = shortest;
    Longest = longest;
    Rate = rate;
    DeadZone = deadZone;
  }
}

/// <summary>How far the end effector may be off straight down, rad, and how fast it follows the tilted controller,
/// rad/s.</summary>
public sealed class Orientation {
  /// <summary>rad, off straight down.</summary>
  public readonly double MostTilt;
  /// <summary>rad/s, at which the end effector follows.</summary>
  public readonly double Rate;

  /// <param name="mostTiltDeg">°.</param>
  /// <param name="rateDeg">°/s.</param>
  public Orientation(double mostTiltDeg, double rateDeg) {
    MostTilt = Vectors.Radians(mostTiltDeg);
    Rate = Vectors.Radians(rateDeg);
  }
}

/// <summary>Half-planes in which the arm bends, rad, from tendon 1 about the arm's axis; by how much less the wrist
/// must turn for another than for the one in use, rad; m from the axis within which the tip target has no
/// direction.</summary>
public sealed class BendingPlane {
  /// <summary>rad, two of them: 0 dorsal, 1 ventral.</summary>
  public readonly IReadOnlyList<double> HalfPlanes;
  /// <summary>rad.</summary>
  public readonly double Hysteresis;
  /// <summary>m.</summary>
  public readonly double Axis;

  /// <param name="halfPlanesDeg">°.</param>
  /// <param name="hysteresisDeg">°.</param>
  /// <param name="axis">m.</param>
  public BendingPlane(IReadOnlyList<double> halfPlanesDeg, double hysteresisDeg, double axis) {
    var planes = new double[halfPlanesDeg.Count];
    for (int i = 0; i < planes.Length; i++) {
      planes[i] = Vectors.Radians(halfPlanesDeg[i]);
    }
    HalfPlanes = planes;
    Hysteresis = Vectors.Radians(hysteresisDeg);
    Axis = axis;
  }
}

/// <summary>When the robot holds; s, and <see cref="Swap"/> in m.</summary>
public sealed class Safety {
  /// <summary>s, for which a controller may be lost.</summary>
  public readonly double Grace;
  /// <summary>s, for which a client may be silent.</summary>
  public readonly double Silence;
  /// <summary>s, for which all must be sound before aiming begins.</summary>
  public readonly double Settle;
  /// <summary>m, how near each controller must appear to where the other was to count as swapped.</summary>
  public readonly double Swap;
  /// <summary>s, for a plan.</summary>
  public readonly double PlanWait;
  /// <summary>s, for the robot to start.</summary>
  public readonly double StartWait;

  /// <param name="grace">A controller may be lost so long, s.</param>
  /// <param name="silence">A client may be silent so long, s.</param>
  /// <param name="settle">All must be sound so long before aiming begins, s.</param>
  /// <param name="swap">How near each controller must appear to where the other was to count as swapped, m.</param>
  /// <param name="planWait">For a plan, s.</param>
  /// <param name="startWait">For the robot to start, s.</param>
  public Safety(double grace, double silence, double settle, double swap, double planWait, double startWait) {
    Grace = grace;
    Silence = silence;
    Settle = settle;
    Swap = swap;
    PlanWait = planWait;
    StartWait = startWait;
  }
}

/// <summary>Settings of the core.</summary>
public sealed class Teleop {
  /// <summary>Whose ray holds the rigid target: 0 the left hand's, 1 the right's.</summary>
  public readonly int RigidHand;
  /// <summary>How long the rays are.</summary>
  public readonly Rays Rays;
  /// <summary>How the end effector is tilted.</summary>
  public readonly Orientation Orientation;
  /// <summary>In which the arm bends, and when it is taken.</summary>
  public readonly BendingPlane BendingPlane;
  /// <summary>Of the controllers' positions.</summary>
  public readonly OneEuro PositionFilter;
  /// <summary>Of the controllers' orientations.</summary>
  public readonly OneEuro OrientationFilter;
  /// <summary>s before a press from which the targets are taken.</summary>
  public readonly double LookBack;
  /// <summary>s from a confirmation to its execution.</summary>
  public readonly double Delay;
  /// <summary>s by which the robot follows.</summary>
  public readonly double FollowDelay;
  /// <summary>m by which a ray must move with its grip held to aim anew while a plan is shown.</summary>
  public readonly double Moved;
  /// <summary>m from a thing's centre within which the tip target marks it.</summary>
  public readonly double Mark;
  /// <summary>When the robot holds.</summary>
  public readonly Safety Safety;

  /// <summary>As the fields of the same names.</summary>
  public Teleop(int rigidHand, Rays rays, Orientation orientation, BendingPlane bendingPlane,
                OneEuro positionFilter, OneEuro orientationFilter, double lookBack, double delay, double followDelay,
                double moved, double mark, Safety safety) {
    RigidHand = rigidHand;
    Rays = rays;
    Orientation = orientation;
    BendingPlane = bendingPlane;
    PositionFilter = positionFilter;
    OrientationFilter = orientationFilter;
    LookBack = lookBack;
    Delay = delay;
    FollowDelay = followDelay;
    Moved = moved;
    Mark = mark;
    Safety = safety;
  }

  /// <summary>From JSON, by the names of conf/shared/core/two_rays.yaml.</summary>
  public static Teleop Read(JsonBlock given) {
    JsonBlock rays = given.Block("rays"), turn = given.Block("orientation"), plane = given.Block("bending_plane");
    var safety = given.Block("safety");
    string hand = given.Text("rigid_hand");
    if (hand != "left" && hand != "right") {
      throw new InputError($"rigid_hand: found {hand}, expected left or right");
    }
    return new Teleop(
        hand == "left" ? 0 : 1,
        new Rays(rays.Number("start"), rays.Number("shortest"), rays.Number("longest"), rays.Number("rate"),
                 rays.Number("dead_zone")),
        new Orientation(turn.Number("most_tilt_deg"), turn.Number("rate_deg")),
        new BendingPlane(plane.Numbers("half_planes_deg"), plane.Number("hysteresis_deg"), plane.Number("axis")),
        ReadFilter(given.Block("position_filter")), ReadFilter(given.Block("orientation_filter")),
        given.Number("look_back"), given.Number("delay"), given.Number("follow_delay"), given.Number("moved"),
        given.Number("mark"),
        new Safety(safety.Number("grace"), safety.Number("silence"), safety.Number("settle"), safety.Number("swap"),
                   safety.Number("plan_wait"), safety.Number("start_wait")));
  }

  private static OneEuro ReadFilter(JsonBlock given) =>
      new OneEuro(given.Number("min_cutoff"), given.Number("beta"), given.Number("derivative_cutoff"));
}
}
