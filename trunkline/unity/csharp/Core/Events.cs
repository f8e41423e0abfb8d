using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>What happened at a step, of all that the state machine answers to, and a line about what was asked for in
/// vain. Port of trunkline/ar/teleop/events.py.</summary>
public static class Events {
  /// <summary>Whether either secondary button is held; it counts even where nothing else of an input does.</summary>
  public static bool StoppedBy(Input given) => given.Left.Secondary || given.Right.Secondary;

  /// <summary>Of a sound step; <paramref name="targets"/> are the present ones, the ends those of the rays. By the
  /// events' numbers, and a line, "" for none.</summary>
  public static (bool[] Found, string Notice) Happened(State state, Input given, Targets targets, Vector? leftEnd,
                                                       Vector? rightEnd, Teleop settings) {
    bool trigger = state.Presses(Buttons.Trigger), stick = state.Presses(Buttons.StickPressed);
    string notice = "";
    if (state.Mode == Mode.Aim && trigger) {
      notice = Placing.WhyNot(LookedBack(state, settings));
    } else if (state.Mode == Mode.Aim && stick) {
      notice = Placing.WhyNot(targets);
      notice = notice == "" && !state.Gripped ? "hold a grip to follow" : notice;
    }
    string changed = ChangedSince(state, given, leftEnd, rightEnd, settings), refused = Refusal(state, given, settings);
    string fault = "";
    if (given.Executor.Mode == ExecutorMode.Fault) {
      fault = given.Executor.Fault == "" ? "no reason given" : given.Executor.Fault;
    } else if (state.Mode == Mode.Execute && !state.Running && state.Waited > settings.Safety.StartWait) {
      fault = $"did not start within {Formats.General(settings.Safety.StartWait)} s";
    }
    bool arrived = given.Executor.Mode == ExecutorMode.Done && given.Executor.Digest == state.Digest;
    var found = new bool[Transitions.Events];
    found[(int)Event.Stop] = StoppedBy(given);
    found[(int)Event.Fault] = fault != "";
    found[(int)Event.Void] = changed != "";
    found[(int)Event.Released] = !state.Gripped;
    found[(int)Event.Refused] = refused != "";
    found[(int)Event.Settled] = state.Idle && state.SoundFor >= settings.Safety.Settle;
    found[(int)Event.Reset] = state.Presses(Buttons.Primary);
    found[(int)Event.Ask] = trigger && notice == "";
    found[(int)Event.Planned] = Answered(state, given) && refused == "";
    found[(int)Event.Shown] = state.Digest != "" && given.Shown == state.Digest;
    found[(int)Event.Confirm] = trigger && state.Gripped;
    found[(int)Event.Elapsed] = state.Waited >= settings.Delay;
    found[(int)Event.Done] = state.Running && arrived;
    found[(int)Event.Follow] = stick && notice == "";
    found[(int)Event.Unfollow] = stick;
    switch (Transitions.FirstEvent(state.Mode, found)) {
      case Event.Fault: return (found, $"robot: {fault}; stopped");
      case Event.Void: return (found, $"{changed}; the plan is void");
      case Event.Refused: return (found, refused);
      case Event.Released: return (found, "grips let go; holding");
      case Event.Stop: return (found, "stopped; primary button goes on");
      default: return (found, notice);
    }
  }

  /// <summary>The targets before the trigger's jerk; the oldest there are where none is old enough; null where there
  /// are none.</summary>
  public static Targets LookedBack(State state, Teleop settings) =>
      state.Before(settings.LookBack) ?? (state.History.Count > 0 ? state.History[0].Targets : null);

  /// <summary>Whether the plan that was asked for is there, or its refusal.</summary>
  public static bool Answered(State state, Input given) =>
      given.Plan != null && state.Pinned != null && given.Plan.Serial == state.Pinned.Request.Serial;

  /// <summary>Why there is no plan, "" where there is one or still may be.</summary>
  public static string Refusal(State state, Input given, Teleop settings) {
    if (Answered(state, given)) {
      PlanReport report = given.Plan;
      Request request = state.Pinned.Request;
      if (report.Refused != "") {
        return $"no plan: {report.Refused}";
      }
      if (report.Package != request.Package || report.World != request.World) {
        return "no plan: it was made for another package or world";
      }
      return report.Digest != "" ? "" : "no plan: it has no digest";
    }
    bool late = state.Mode == Mode.Plan && state.Waited > settings.Safety.PlanWait;
    return late ? $"no plan within {Formats.General(settings.Safety.PlanWait)} s" : "";
  }

  /// <summary>Whether the assistant's offer for the plan that is shown is taken: the rigid hand's primary, its grip let
  /// go.</summary>
  public static bool TakesOffer(State state, Input given, Teleop settings) {
    var hand = state.HandOf(settings.RigidHand);
    bool mine = state.Pinned != null && given.Offer != null
        && given.Offer.Thing == state.Pinned.Request.Targets.Thing;
    return mine && hand.Presses(Buttons.Primary) && !hand.Grips;
  }

  /// <summary>What has changed of that for which the plan was made, "" where nothing has.</summary>
  public static string ChangedSince(State state, Input given, Vector? leftEnd, Vector? rightEnd, Teleop settings) {
    if (state.Pinned == null) {
      return "";
    }
    if (!given.World.IsAs(state.Pinned.World)) {
      return "world changed";
    }
    if (!Pose.Same(given.Alignment, state.Pinned.Alignment)) {
      return "base alignment changed";
    }
    var mode = state.Mode;
    if ((mode == Mode.Preview || mode == Mode.Ready) && TakesOffer(state, given, settings)) {
      return "the offer was taken";
    }
    if ((mode == Mode.Ready || mode == Mode.Delay) && given.Shown != state.Digest) {
      return "another plan was shown";
    }
    if (mode == Mode.Plan || mode == Mode.Preview || mode == Mode.Ready) {
      if (HasMoved(state.Left, leftEnd, settings) || HasMoved(state.Right, rightEnd, settings)) {
        return "target moved";
      }
    }
    return "";
  }

  private static bool HasMoved(Hand hand, Vector? end, Teleop settings) =>
      hand.GrippedAt != null && end != null && hand.Grips
      && Distance(hand.GrippedAt.Value, end.Value) > settings.Moved;
}
}
