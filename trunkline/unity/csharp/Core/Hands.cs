using System;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>Of one controller, one bit each: what several say together is their sum.</summary>
[Flags]
public enum Buttons {
  /// <summary>Nothing is held.</summary>
  None = 0,
  /// <summary>Asks for a plan and confirms it.</summary>
  Trigger = 1,
  /// <summary>Moves its hand's target, and lets the robot move.</summary>
  Grip = 2,
  /// <summary>Begins and ends following.</summary>
  StickPressed = 4,
  /// <summary>A or X: takes an offer, with the grip tilts the end effector, and ends a stop.</summary>
  Primary = 8,
  /// <summary>B or Y: stops.</summary>
  Secondary = 16,
}

/// <summary>What a hand was at the step before. It never changes; the core makes another.</summary>
public sealed class Hand {
  /// <summary>Of the ray, m.</summary>
  public double Length { get; internal set; }
  /// <summary>Its controller as last heard, tracked and finite; null where it was lost.</summary>
  public Controller Seen { get; internal set; }
  /// <summary>Filtered, reference frame; null where it was lost.</summary>
  public Smoothed Pose { get; internal set; }
  /// <summary>s since it was seen.</summary>
  public double LostFor { get; internal set; }
  /// <summary>Where it stays, base frame, m; null until a grip has set it.</summary>
  public Vector? Target { get; internal set; }
  /// <summary>End of the ray when the grip was pressed, base frame, m, of a press since a plan was asked for.</summary>
  public Vector? GrippedAt { get; internal set; }
  /// <summary>Buttons that are held at this step.</summary>
  public Buttons Held { get; internal set; }
  /// <summary>Buttons that went down at this step.</summary>
  public Buttons Pressed { get; internal set; }

  /// <param name="length">Of the ray, m.</param>
  public Hand(double length) {
    Length = length;
  }

  /// <summary>Whether its grip is held.</summary>
  public bool Grips => Holds(Buttons.Grip);

  internal bool Holds(Buttons one) => (Held & one) != 0;

  internal bool Presses(Buttons one) => (Pressed & one) != 0;

  internal Hand Copy() => (Hand)MemberwiseClone();
}

/// <summary>One hand: its controller's pose as filtered, its ray, and which buttons it has pressed since the step
/// before. Port of trunkline/ar/teleop/tracked_controller.py.</summary>
public static class Hands {
  private static readonly Vector _ahead = new Vector(0, 0, -1);  // of a controller's pose: along its ray
  private static readonly Vector _below = new Vector(0, -1, 0);  // down, where it is held level

  /// <summary>The hand after a sound <paramref name="given"/>, <paramref name="sample"/> s after the one before.
  /// Buttons held when a controller appears are not presses: a press is what was seen to go down.</summary>
  public static Hand Hear(Hand hand, Controller given, double sample, Teleop settings) {
    var held = (given.Trigger ? Buttons.Trigger : 0) | (given.Grip ? Buttons.Grip : 0)
        | (given.StickPressed ? Buttons.StickPressed : 0) | (given.Primary ? Buttons.Primary : 0)
        | (given.Secondary ? Buttons.Secondary : 0);
    var next = hand.Copy();
    next.Seen = given;
    next.Pose = OneEuro.Smooth(hand.Pose, given.Position, given.Quaternion, sample, settings.PositionFilter,
                               settings.OrientationFilter);
    next.LostFor = 0;
    next.Length = RayLength(hand.Length, given.StickY, sample, settings.Rays);
    next.Held = held;
    next.Pressed = hand.Seen == null ? Buttons.None : held & ~hand.Held;
    return next;
  }

  /// <summary>The hand where its controller was not heard for another <paramref name="dt"/> s; beyond
  /// <paramref name="grace"/> s, it holds nothing any more.</summary>
  public static Hand Missed(Hand hand, double dt, double grace) {
    var next = hand.Copy();
    next.LostFor = hand.LostFor + dt;
    next.Pressed = Buttons.None;
    if (!(next.LostFor <= grace)) {
      next.Held = Buttons.None;
      next.Seen = null;
      next.Pose = null;
      next.GrippedAt = null;
    }
    return next;
  }

  /// <summary>The length, m, after <paramref name="dt"/> s of the stick's deflection, -1 (in) to 1 (out); it ends at
  /// both limits.</summary>
  public static double RayLength(double length, double stick, double dt, Rays rays) {
    if (Math.Abs(stick) <= rays.DeadZone) {
      return length;
    }
    double share = (Math.Abs(stick) - rays.DeadZone) / (1 - rays.DeadZone);
    double change = rays.Rate * Math.Min(share, 1) * dt;
    return Math.Min(Math.Max(length + (stick > 0 ? change : -change), rays.Shortest), rays.Longest);
  }

  /// <summary>End of the ray in the base frame, m; null where the hand is not seen.</summary>
  public static Vector? RayEnd(Hand hand, Pose alignment) {
    if (hand.Pose == null) {
      return null;
    }
    var reach = Add(hand.Pose.Position, Scale(Rotate(hand.Pose.Quaternion, _ahead), hand.Length));
    return Add(alignment.Position, Rotate(alignment.Quaternion, reach));
  }

  /// <summary>The controller's own downward direction in the base frame, unit length, to which the end effector is
  /// aligned; null where the hand is not seen.</summary>
  public static Vector? Below(Hand hand, Pose alignment) =>
      hand.Pose == null ? (Vector?)null : Rotate(Multiply(alignment.Quaternion, hand.Pose.Quaternion), _below);
}
}
