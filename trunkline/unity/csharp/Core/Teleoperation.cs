using System;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>The core of teleoperation: one pure function from what is heard to what is wanted. Port of
/// trunkline/ar/teleop/core.py.
///
/// <see cref="Step"/> has no clock, threads or sockets; the same inputs give the same intents. It decides; it does not
/// move anything: planning, preview and motion are done outside and reported in the next input.</summary>
public sealed class Teleoperation {
  /// <summary>What it is set by.</summary>
  public readonly Teleop Settings;
  /// <summary>What can be reached.</summary>
  public readonly IReach Reach;
  /// <summary>Digest: an input that names another makes the robot hold.</summary>
  public readonly string Package;
  /// <summary>m, from the flange to the mount.</summary>
  public readonly double MountOffset;

  /// <param name="settings">Of the core.</param>
  /// <param name="reach">What can be reached.</param>
  /// <param name="package">The package's digest.</param>
  /// <param name="mountOffset">From the flange to the mount, m.</param>
  public Teleoperation(Teleop settings, IReach reach, string package, double mountOffset) {
    Settings = settings;
    Reach = reach;
    Package = package;
    MountOffset = mountOffset;
  }

  /// <summary>Before the first input: the robot holds.</summary>
  public State Start() => new State(new Hand(Settings.Rays.Start), new Hand(Settings.Rays.Start));

  /// <summary>The state after <paramref name="given"/>, and what is wanted now.</summary>
  /// <param name="state">After the step before; it stays as it is.</param>
  /// <param name="given">What is heard.</param>
  /// <param name="dt">s since the step before, of the caller's clock; stamps are of the client's.</param>
  public (State State, Intent Intent) Step(State state, Input given, double dt) {
    var next = state.Copy();
    var (lost, unheard) = Hear(next, given, dt);
    var alignment = given.Alignment;
    if (lost == "" && !IsWatching(next.Mode)) {
      lost = unheard;
    }
    if (lost != "" || alignment == null) {
      var nothing = new bool[Transitions.Events];
      nothing[(int)Event.Lost] = true;
      nothing[(int)Event.Stop] = Events.StoppedBy(given);
      return After(next, given, nothing, lost, null, dt, null, null);
    }
    if (!Pose.Same(next.Alignment, alignment)) {  // what is parked in the base frame is elsewhere in the room now
      next.Alignment = alignment;
      for (int i = 0; i < 2; i++) {
        var hand = next.HandOf(i).Copy();
        hand.Target = null;
        next.SetHand(i, hand);
      }
      next.History = State.Nothing;
    }
    if (next.World != given.World.Digest) {  // what was judged before was judged in another world
      next.World = given.World.Digest;
      next.History = State.Nothing;
    }
    Vector? leftEnd = Hands.RayEnd(next.Left, alignment), rightEnd = Hands.RayEnd(next.Right, alignment);
    Park(next, leftEnd, rightEnd, alignment, dt);
    var targets = TargetsOf(next, given);
    string beyond = "";
    if (next.Mode == Mode.Follow && targets != null) {
      (targets, beyond) = Nearest(next, given, targets);
    }
    if (targets != null) {
      Remember(next, targets);
    }
    var (found, word) = Events.Happened(next, given, targets, leftEnd, rightEnd, Settings);
    found[(int)Event.Confirm] &= unheard == "";
    var (after, intent) = After(next, given, found, word, targets, dt, leftEnd, rightEnd);
    string notice = unheard != "" || intent.Mode != Mode.Follow ? unheard : beyond;
    return (after, notice == "" ? intent : intent.WithNotice(notice));
  }

  // The functions below change `state`, which is the copy that `Step` has made and nobody else has seen.

  // Both hands after this input; why nothing of it can be trusted; and who is not heard. Either is "" where nothing is
  // wrong, and else the robot must hold.
  private (string Lost, string Unheard) Hear(State state, Input given, double dt) {
    bool same = given.Stamp == state.Stamp;
    double silent = same && IsFinite(dt) ? state.Silent + dt : 0;
    string fault = Soundness.ClockFault(state.Stamp, given, dt);
    string quiet = fault != "" ? "" : Soundness.SilenceFault(state.Stamp, given.Stamp, silent, Settings.Safety);
    if (fault != "" || quiet != "") {
      state.Left = Hands.Missed(state.Left, double.PositiveInfinity, 0);
      state.Right = Hands.Missed(state.Right, double.PositiveInfinity, 0);
      state.Stamp = IsFinite(given.Stamp) ? given.Stamp : state.Stamp;  // from which time counts anew
      state.Silent = silent;
      state.History = State.Nothing;
      return (fault != "" ? fault : Soundness.SettingFault(given, Package), quiet);
    }
    if (same) {
      for (int i = 0; i < 2; i++) {
        var hand = state.HandOf(i).Copy();
        hand.Pressed = Buttons.None;
        state.SetHand(i, hand);
      }
      state.Silent = silent;
      return (Soundness.SettingFault(given, Package), "");
    }
    double sample = state.Stamp == null ? dt : given.Stamp - state.Stamp.Value;
    Hand left = state.Left, right = state.Right;
    string wrongLeft = Soundness.FaultOf(given.Left), wrongRight = Soundness.FaultOf(given.Right);
    state.Left = HearOne(left, given.Left, wrongLeft, sample);
    state.Right = HearOne(right, given.Right, wrongRight, sample);
    string unseen = "";
    if (wrongLeft != "" && state.Left.Seen == null) {
      unseen = $"left controller: {wrongLeft}; holding";
    } else if (wrongRight != "" && state.Right.Seen == null) {
      unseen = $"right controller: {wrongRight}; holding";
    }
    bool sound = wrongLeft == "" && wrongRight == "";
    if (sound && Soundness.Swapped(left, right, given, Settings.Safety.Swap)) {
      state.Left = Hands.Missed(state.Left, double.PositiveInfinity, 0);
      state.Right = Hands.Missed(state.Right, double.PositiveInfinity, 0);
      fault = "controllers have changed places; holding until both grips are let go";
    }
    state.Stamp = given.Stamp;
    state.Silent = 0;
    string setting = Soundness.SettingFault(given, Package);
    return (setting != "" ? setting : fault, unseen);
  }

  private Hand HearOne(Hand hand, Controller given, string wrong, double sample) =>
      wrong == "" ? Hands.Hear(hand, given, sample, Settings) : Hands.Missed(hand, sample, Settings.Safety.Grace);

  // Targets that are held by their grips moved to the ends of their rays; the others stay where they are.
  private void Park(State state, Vector? leftEnd, Vector? rightEnd, Pose alignment, double dt) {
    for (int index = 0; index < 2; index++) {
      var hand = state.HandOf(index).Copy();
      var end = index == 0 ? leftEnd : rightEnd;
      if (!IsAiming(state.Mode)) {
        hand.GrippedAt = hand.Presses(Buttons.Grip) ? end : hand.Grips ? hand.GrippedAt : null;
      } else if (hand.Grips && end != null && hand.LostFor == 0) {
        var down = Hands.Below(hand, alignment);
        if (index == Settings.RigidHand && hand.Holds(Buttons.Primary) && down != null) {
          var (pointing, limited) = Placing.Tilted(state.Pointing, down.Value, dt, Settings.Orientation);
          state.Pointing = pointing;
          state.Limited = limited;
        } else {
          hand.Target = end;
        }
      }
      state.SetHand(index, hand);
    }
  }

  private static bool IsAiming(Mode mode) => mode == Mode.Aim || mode == Mode.Follow;

  // Where nothing moves: a plan outlives that its user is not heard for a while.
  private static bool IsWatching(Mode mode) => mode == Mode.Plan || mode == Mode.Preview || mode == Mode.Ready;

  // Modes that a change of the world concerns.
  private static bool IsPlanned(Mode mode) => mode >= Mode.Plan && mode <= Mode.Follow;

  private Targets TargetsOf(State state, Input given) {
    if (!IsAiming(state.Mode) && state.Pinned != null) {
      return Placing.Offered(state.Pinned.Request.Targets, given.Offer);
    }
    Vector? rigid = state.HandOf(Settings.RigidHand).Target, tip = state.HandOf(1 - Settings.RigidHand).Target;
    var held = given.World.Held;
    if (rigid == null || (tip == null && held == null)) {
      return null;
    }
    var placed = Placed(rigid.Value, tip, state, given);
    return held != null ? placed : Placing.Offered(placed, given.Offer);
  }

  // Targets there; `tip` may be null where the arm holds an object.
  private Targets Placed(Vector rigid, Vector? tip, State state, Input given) {
    var wrist = Alignment.WristOf(given.Joints, MountOffset);
    var held = given.World.Held;
    return held != null
        ? Placing.Bring(held, rigid, state.Pointing, state.Limited, wrist, state.Aligned.HalfPlane, given.World, Reach)
        : Placing.Place(rigid, tip.Value, state.Pointing, state.Limited, wrist, state.Aligned, given.World, Reach,
                        Settings);
  }

  // What is followed in place of `targets`, and a notice of it: these, "" where they are within reach; else what is
  // offered, the mount's place first, as it moves what the arm reaches; these where that is not within either.
  private (Targets Followed, string Notice) Nearest(State state, Input given, Targets targets) {
    string reason = Placing.OutOfReach(targets);
    if (reason == "") {
      return (targets, "");
    }
    var rigid = targets.Rigid.Offer ?? targets.Rigid.Position;
    var nearest = Placed(rigid, targets.Tip.Position, state, given);
    if (nearest.Tip.Offer != null) {
      nearest = Placed(rigid, nearest.Tip.Offer, state, given);
    }
    return Placing.WhyNot(nearest) != ""
        ? (targets, "") : (nearest, $"{reason}; the robot goes to the nearest point within");
  }

  // `targets` in the history, which keeps what may be looked back to.
  private void Remember(State state, Targets targets) {
    double now = state.Stamp.Value;
    state.Aligned = new Aligned(targets.Heading, targets.HalfPlane, targets.Turned);
    var history = state.History;
    if (history.Count > 0 && now <= history[history.Count - 1].Stamp) {
      return;
    }
    double since = now - Math.Max(Settings.LookBack, Settings.FollowDelay);
    int older = 0;  // of which the newest is still looked back to
    foreach (var one in history) {
      older += one.Stamp <= since ? 1 : 0;
    }
    state.History = state.HistoryFrom(Math.Max(older - 1, 0), new Remembered(now, targets));
  }

  // The next state by the table, and its intent.
  private (State, Intent) After(State state, Input given, bool[] found, string notice, Targets targets, double dt,
                                Vector? leftEnd, Vector? rightEnd) {
    var before = state.Mode;
    var happened = Transitions.FirstEvent(before, found);
    var mode = happened == null ? before : Transitions.After(before, happened.Value).Value;
    double step = IsFinite(dt) && dt > 0 ? dt : 0;
    bool quiet = state.Idle && !found[(int)Event.Lost];
    state.Mode = mode;
    state.Waited = mode == before ? state.Waited + step : 0;
    state.SoundFor = quiet ? state.SoundFor + step : 0;
    state.Notice = notice != "" ? notice : mode == before ? state.Notice : "";
    state.Running = mode == Mode.Execute && (state.Running || given.Executor.Mode == ExecutorMode.Running);
    if (happened == Event.Ask) {
      AskFor(state, given);
      targets = state.Pinned.Request.Targets;
    } else if (happened == Event.Planned) {
      state.Digest = given.Plan.Digest;
    } else if (happened == Event.Follow) {
      state.Pinned = Pin(state.Serial, targets, given);
      state.History = state.HistoryFrom(Math.Max(state.History.Count - 1, 0));
    } else if (mode == Mode.Aim && (before == Mode.Aim || happened == Event.Void)) {
      TakeOffers(state, targets);
    }
    if (!IsPlanned(mode)) {
      state.Pinned = null;
      state.Digest = "";
      state.Following = null;
    }
    if (mode == Mode.Hold || mode == Mode.Stopped || (mode == Mode.Aim && mode != before)) {
      state.History = State.Nothing;
    }
    if (mode == Mode.Follow) {
      var wanted = state.Before(Settings.FollowDelay);
      state.Following = Placing.WhyNot(wanted) != "" ? state.Following : wanted;
    }
    return (state, IntentOf(state, targets, leftEnd, rightEnd));
  }

  // Everything pinned to what the plan is asked for; both hands' targets are those of before the press.
  private void AskFor(State state, Input given) {
    var wanted = Events.LookedBack(state, Settings).WithBetter(null);  // an offer was of an older plan
    for (int i = 0; i < 2; i++) {
      var hand = state.HandOf(i).Copy();
      hand.GrippedAt = null;
      hand.Target = i == Settings.RigidHand ? wanted.Rigid.Position : wanted.Tip.Position;
      state.SetHand(i, hand);
    }
    state.Serial++;
    state.Pinned = Pin(state.Serial, wanted, given);
  }

  private Pinned Pin(int serial, Targets targets, Input given) =>
      new Pinned(new Request(serial, targets, given.World.Digest, Package), given.Alignment, given.World);

  // Targets moved to what was offered, of hands whose primary button was pressed with the grip let go.
  private void TakeOffers(State state, Targets targets) {
    for (int index = 0; index < 2 && targets != null; index++) {
      var hand = state.HandOf(index);
      if (!hand.Presses(Buttons.Primary) || hand.Grips) {
        continue;
      }
      var offer = (index == Settings.RigidHand ? targets.Rigid : targets.Tip).Offer;
      if (index == Settings.RigidHand && targets.Better != null) {
        offer = targets.Better.Rigid;
        state.Pointing = targets.Better.Pointing;
      }
      hand = hand.Copy();
      hand.Target = offer ?? hand.Target;
      state.SetHand(index, hand);
    }
  }

  private Intent IntentOf(State state, Targets targets, Vector? leftEnd, Vector? rightEnd) {
    var mode = state.Mode;
    var motion = mode == Mode.Execute ? Motion.Execute
        : mode == Mode.Follow && state.Following != null ? Motion.Follow : Motion.Hold;
    string notice = state.Notice;
    if (mode == Mode.Follow && Placing.WhyNot(targets) is string why && why != "") {
      string reason = Placing.OutOfReach(targets);
      notice = $"{(reason != "" ? reason : why)}; the robot stays at the last within reach";
    }
    bool shown = mode == Mode.Preview || mode == Mode.Ready || mode == Mode.Delay;
    return new Intent(
        mode, motion, notice, targets, leftEnd, rightEnd,
        mode == Mode.Plan && state.Pinned != null ? state.Pinned.Request : null,
        shown ? state.Digest : "",
        mode == Mode.Execute ? state.Digest : "",
        mode == Mode.Delay ? Math.Max(Settings.Delay - state.Waited, 0) : 0,
        motion == Motion.Follow ? state.Following : null);
  }
}
}
