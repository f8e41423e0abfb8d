using System;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>Targets: where both rays want the robot, tested against what it can reach and what stands in the way. Port
/// of trunkline/ar/teleop/targets.py.</summary>
public static class Placing {
  /// <summary>Both targets (base frame, m) with their reach under the gravity that the arm will have there. A tip
  /// target that marks a thing is where the arm grips it.</summary>
  public static Targets Place(Vector rigid, Vector tip, Vector pointing, bool limited, Wrist wrist, Aligned last,
                              World world, IReach reach, Teleop settings) {
    var thing = Marked(tip, world, settings.Mark);
    tip = thing == null ? tip : Things.GripOf(thing);
    var aligned = Alignment.Align(tip, rigid, pointing, wrist, last, settings.BendingPlane);
    var turn = Alignment.BaseQuaternion(pointing, aligned.Heading);
    var back = Conjugate(turn);
    var found = new Reading(Where.Unknown);
    if (thing == null) {
      found = reach.Soft(Rotate(back, Subtract(tip, rigid)), Rotate(back, Down));
    }
    Vector? offer = found.Offer == null ? (Vector?)null : Add(rigid, Rotate(turn, found.Offer.Value));
    return new Targets(
        TargetAt(rigid, reach.Rigid(rigid, pointing), world),
        TargetAt(tip, found.WithOffer(offer), world),
        pointing, aligned.Heading, aligned.HalfPlane, aligned.Turned, limited, thing == null ? "" : thing.Name);
  }

  /// <summary>Targets of an arm that holds a thing: the mount goes to <paramref name="rigid"/>, m, the wrist as joint 1
  /// carries it, and the tip target is where what it grips comes to.</summary>
  public static Targets Bring(Thing held, Vector rigid, Vector pointing, bool limited, Wrist wrist, int halfPlane,
                              World world, IReach reach) {
    double heading = Alignment.CarriedHeading(rigid, wrist);
    var there = Alignment.BaseQuaternion(pointing, heading);
    var here = Alignment.BaseQuaternion(wrist.Pointing, wrist.Heading);
    var beside = Rotate(Conjugate(here), Subtract(Things.GripOf(held), wrist.Position));
    var tip = Add(rigid, Rotate(there, beside));
    return new Targets(
        TargetAt(rigid, reach.Rigid(rigid, pointing), world),
        TargetAt(tip, new Reading(Where.Unknown), world),
        pointing, heading, halfPlane, 0, limited, held.Name);
  }

  /// <summary>The thing nearest to the tip target, at most <paramref name="within"/> m from it; null for
  /// none.</summary>
  public static Thing Marked(Vector tip, World world, double within) {
    Thing nearest = null;
    double least = double.PositiveInfinity;
    foreach (var thing in world.Things) {
      double away = Distance(tip, Things.GripOf(thing));
      if (away <= within && away < least) {
        nearest = thing;
        least = away;
      }
    }
    return nearest;
  }

  /// <summary>The targets with the assistant's offer, where it is for the thing that they mark.</summary>
  public static Targets Offered(Targets targets, Offer offer) =>
      offer != null && offer.Thing == targets.Thing ? targets.WithBetter(offer) : targets;

  private static Target TargetAt(Vector position, Reading reading, World world) {
    foreach (var box in world.Boxes) {
      if (box.Has(position)) {
        return new Target(position, Where.Blocked, solid: box.Name);
      }
    }
    return new Target(position, reading.Where, reading.OutsideBy, reading.Offer);
  }

  /// <summary>Where the end effector points after <paramref name="dt"/> s of following the direction
  /// <paramref name="toward"/>, and whether that is tilted further than it may be: then it stays at the largest tilt in
  /// that direction.</summary>
  public static (Vector Pointing, bool Limited) Tilted(Vector pointing, Vector toward, double dt,
                                                       Orientation settings) {
    double tilt = Math.Acos(Math.Min(Math.Max(Dot(toward, Down), -1), 1));
    bool limited = tilt > settings.MostTilt;
    if (limited) {
      toward = Turned(Down, toward, settings.MostTilt);
    }
    double angle = Math.Acos(Math.Min(Math.Max(Dot(pointing, toward), -1), 1)), step = settings.Rate * dt;
    return (angle <= step ? toward : Turned(pointing, toward, step), limited);
  }

  private static Vector Turned(Vector a, Vector b, double angle) {
    var axis = Cross(a, b);
    double length = Norm(axis);
    if (length < 1e-12) {  // opposite: any way is as short
      axis = new Vector(1, 0, 0);
      length = 1;
    }
    var side = Cross(Scale(axis, 1 / length), a);
    var found = Add(Scale(a, Math.Cos(angle)), Scale(side, Math.Sin(angle)));
    return Scale(found, 1 / Norm(found));
  }

  /// <summary>Why no plan can be asked for, in one line; "" where one can.</summary>
  public static string WhyNot(Targets targets) {
    if (targets == null) {
      return "both targets are needed: hold a grip to set each";
    }
    string why = WhyNot("rigid", targets.Rigid);
    why = why == "" ? WhyNot("tip", targets.Tip) : why;
    return why == "" && targets.Turned == null ? "wrist cannot turn the arm's bending plane to the tip target" : why;
  }

  private static string WhyNot(string name, Target target) {
    if (target.Reach == Where.Blocked) {
      return $"{name} target is inside {target.Solid}";
    }
    if (target.Reach != Where.Outside) {
      return "";
    }
    string offered = target.Offer != null ? "; primary button takes the nearest point that is within" : "";
    return ByHowMuch(name, target) + offered;
  }

  // Which target is out of reach, in one line; "" where none is.
  internal static string OutOfReach(Targets targets) =>
      targets == null ? ""
      : targets.Rigid.Reach == Where.Outside ? ByHowMuch("rigid", targets.Rigid)
      : targets.Tip.Reach == Where.Outside ? ByHowMuch("tip", targets.Tip) : "";

  private static string ByHowMuch(string name, Target target) =>
      $"{name} target is {Formats.Fixed(1e3 * target.OutsideBy, 0)} mm out of reach";
}
}
