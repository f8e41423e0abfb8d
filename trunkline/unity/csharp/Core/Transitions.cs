using System;

namespace Trunkline {

/// <summary>What happens at a step, in the order in which they count where several come at once: what stops the robot
/// comes first.</summary>
public enum Event {
  /// <summary>Secondary button.</summary>
  Stop,
  /// <summary>The robot reports a fault, or does not start.</summary>
  Fault,
  /// <summary>Clock, alignment or package is not sound; but in plan, preview, ready also: a controller, the
  /// client.</summary>
  Lost,
  /// <summary>Target, world or alignment changed.</summary>
  Void,
  /// <summary>Both grips let go.</summary>
  Released,
  /// <summary>No plan, with the reason.</summary>
  Refused,
  /// <summary>All sound for a while, grips and triggers let go.</summary>
  Settled,
  /// <summary>Primary button.</summary>
  Reset,
  /// <summary>Trigger, both targets within reach.</summary>
  Ask,
  /// <summary>The plan is there.</summary>
  Planned,
  /// <summary>Its preview has been shown to its end.</summary>
  Shown,
  /// <summary>Trigger pressed afresh, a grip held.</summary>
  Confirm,
  /// <summary>The delay is over.</summary>
  Elapsed,
  /// <summary>The robot has arrived.</summary>
  Done,
  /// <summary>Stick pressed, a grip held.</summary>
  Follow,
  /// <summary>Stick pressed.</summary>
  Unfollow,
}

/// <summary>The state machine as a table: which event leads from which mode to which. What is not in it is forbidden.
/// Port of trunkline/ar/teleop/transitions.py, which says what each event means.</summary>
public static class Transitions {
  private const int _modes = (int)Mode.Stopped + 1;

  internal const int Events = (int)Event.Unfollow + 1;

  private static readonly Mode?[,] _table = Table();

  /// <summary>The mode that follows; null where <paramref name="mode"/> does not answer to the event.</summary>
  public static Mode? After(Mode mode, Event happened) => _table[(int)mode, (int)happened];

  /// <summary>Of the events that happened, by their number, the first that <paramref name="mode"/> answers to; null for
  /// none.</summary>
  public static Event? FirstEvent(Mode mode, bool[] happened) {
    for (int i = 0; i < Events; i++) {
      if (happened[i] && _table[(int)mode, i] != null) {
        return (Event)i;
      }
    }
    return null;
  }

  private static Mode?[,] Table() {
    var table = new Mode?[_modes, Events];
    Action<Mode, Event, Mode> leads = (mode, happened, after) => table[(int)mode, (int)happened] = after;
    leads(Mode.Hold, Event.Settled, Mode.Aim);
    leads(Mode.Aim, Event.Ask, Mode.Plan);
    leads(Mode.Aim, Event.Follow, Mode.Follow);
    leads(Mode.Plan, Event.Planned, Mode.Preview);
    leads(Mode.Plan, Event.Refused, Mode.Aim);
    leads(Mode.Preview, Event.Shown, Mode.Ready);
    leads(Mode.Ready, Event.Confirm, Mode.Delay);
    leads(Mode.Delay, Event.Released, Mode.Ready);
    leads(Mode.Delay, Event.Elapsed, Mode.Execute);
    leads(Mode.Execute, Event.Done, Mode.Aim);
    leads(Mode.Execute, Event.Released, Mode.Hold);
    leads(Mode.Execute, Event.Void, Mode.Hold);
    leads(Mode.Follow, Event.Unfollow, Mode.Aim);
    leads(Mode.Follow, Event.Released, Mode.Hold);
    leads(Mode.Follow, Event.Void, Mode.Hold);
    leads(Mode.Stopped, Event.Reset, Mode.Hold);
    foreach (var mode in new[] { Mode.Plan, Mode.Preview, Mode.Ready, Mode.Delay }) {
      leads(mode, Event.Void, Mode.Aim);
    }
    leads(Mode.Execute, Event.Fault, Mode.Stopped);
    leads(Mode.Follow, Event.Fault, Mode.Stopped);
    for (var mode = Mode.Hold; mode < Mode.Stopped; mode++) {
      leads(mode, Event.Stop, Mode.Stopped);
      if (mode != Mode.Hold) {
        leads(mode, Event.Lost, Mode.Hold);
      }
    }
    return table;
  }
}
}
