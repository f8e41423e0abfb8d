using System;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>Whether an input can be trusted. What cannot has a one-line answer, and the robot holds. Port of
/// trunkline/ar/teleop/input_validation.py.</summary>
public static class Soundness {
  private const double _unit = 1e-2;  // by which the length of a quaternion may differ from 1

  /// <summary>Why a controller's pose cannot be used, "" where it can.</summary>
  public static string FaultOf(Controller controller) {
    if (!controller.Tracked) {
      return "not tracked";
    }
    if (!IsFinite(controller.Position) || !IsFinite(controller.Quaternion) || !IsFinite(controller.StickX)
        || !IsFinite(controller.StickY)) {
      return "pose is not a number";
    }
    return Math.Abs(Length(controller.Quaternion) - 1) > _unit ? "quaternion is not of unit length" : "";
  }

  /// <summary>Why time cannot be trusted, "" where it can.</summary>
  public static string ClockFault(double? last, Input given, double dt) {
    if (!IsFinite(dt) || dt <= 0) {
      return $"step of {Formats.General(dt)} s: expected a positive time; holding";
    }
    if (!IsFinite(given.Stamp)) {
      return "stamp is not a number; holding";
    }
    return given.Stamp < last ? $"clock went back by {Formats.General(last.Value - given.Stamp, 3)} s; holding" : "";
  }

  /// <summary>Why the client counts as silent, "" where it does not; <paramref name="silent"/> s is how long no new
  /// stamp has come.</summary>
  public static string SilenceFault(double? last, double stamp, double silent, Safety safety) {
    double gap = last == null ? silent : Math.Max(silent, stamp - last.Value);
    return gap > safety.Silence ? $"client silent for {Formats.Fixed(gap, 2)} s; holding" : "";
  }

  /// <summary>Why the robot, its base or the package cannot be trusted, "" where they can.</summary>
  public static string SettingFault(Input given, string package) {
    if (given.Package != package) {
      string found = Formats.First(given.Package ?? "", 12);
      return $"package: found digest {(found == "" ? "none" : found)}, expected {Formats.First(package, 12)}; holding";
    }
    if (given.Alignment == null) {
      return "base is not aligned; holding";
    }
    if (!IsSound(given.Alignment)) {
      return "base alignment is not a pose; holding";
    }
    foreach (double angle in given.Joints) {
      if (!IsFinite(angle)) {
        return "robot's joints are not numbers; holding";
      }
    }
    return "";
  }

  /// <summary>Whether each controller appears where the other was: at most <paramref name="within"/> m from there, and
  /// further from its own.</summary>
  public static bool Swapped(Hand left, Hand right, Input given, double within) {
    if (left.Seen == null || right.Seen == null) {
      return false;
    }
    Vector a = left.Seen.Position, b = right.Seen.Position, c = given.Left.Position, d = given.Right.Position;
    double across = Math.Max(Distance(c, b), Distance(d, a)), along = Math.Min(Distance(c, a), Distance(d, b));
    return across <= within && along > 2 * within;
  }

  private static bool IsSound(Pose pose) =>
      IsFinite(pose.Position) && IsFinite(pose.Quaternion) && Math.Abs(Length(pose.Quaternion) - 1) <= _unit;
}
}
