using System;
using System.Collections.Generic;

namespace Trunkline {

/// <summary>What a plan was asked for: any change of it voids the plan.</summary>
public sealed class Pinned {
  /// <summary>What was asked for, or is followed.</summary>
  public readonly Request Request;
  /// <summary>Of the reference frame in the base frame, m.</summary>
  public readonly Pose Alignment;
  /// <summary>As it was then.</summary>
  public readonly World World;

  /// <summary>As the fields of the same names.</summary>
  public Pinned(Request request, Pose alignment, World world) {
    Request = request;
    Alignment = alignment;
    World = world;
  }
}

/// <summary>The targets at a stamp, s, of the client's clock.</summary>
public readonly struct Remembered {
  /// <summary>s, of the client's clock.</summary>
  public readonly double Stamp;
  /// <summary>As they were then.</summary>
  public readonly Targets Targets;

  /// <summary>As the fields of the same names.</summary>
  public Remembered(double stamp, Targets targets) {
    Stamp = stamp;
    Targets = targets;
  }
}

/// <summary>All that the core remembers from step to step: trunkline/ar/teleop/state.py. It never changes; a step makes
/// another.</summary>
public sealed class State {
  internal static readonly IReadOnlyList<Remembered> Nothing = new Remembered[0];

  /// <summary>As it was at the step before.</summary>
  public Hand Left { get; internal set; }
  /// <summary>As it was at the step before.</summary>
  public Hand Right { get; internal set; }
  /// <summary>What the session is at.</summary>
  public Mode Mode { get; internal set; } = Mode.Hold;
  /// <summary>The last, s, of the client's clock; null before the first.</summary>
  public double? Stamp { get; internal set; }
  /// <summary>s without a new stamp.</summary>
  public double Silent { get; internal set; }
  /// <summary>s for which all was sound and nothing pressed.</summary>
  public double SoundFor { get; internal set; }
  /// <summary>s in this mode.</summary>
  public double Waited { get; internal set; }
  /// <summary>Direction in which the end effector shall point, base frame, unit length.</summary>
  public Vector Pointing { get; internal set; } = Vectors.Down;
  /// <summary>The controller was tilted further than the end effector may be.</summary>
  public bool Limited { get; internal set; }
  /// <summary>How the wrist shall be turned, as of the last targets.</summary>
  public Aligned Aligned { get; internal set; } = new Aligned(0, 0, 0);
  /// <summary>Of the reference frame in the base frame, m; null before the first.</summary>
  public Pose Alignment { get; internal set; }
  /// <summary>Its digest.</summary>
  public string World { get; internal set; } = "";
  /// <summary>Of the last while in this mode, to look back from a press and to follow with a delay.</summary>
  public IReadOnlyList<Remembered> History { get; internal set; } = Nothing;
  /// <summary>Of the last request; 0 before the first.</summary>
  public int Serial { get; internal set; }
  /// <summary>From a request, or the begin of following, until the mode is hold, aim or stopped; else null.</summary>
  public Pinned Pinned { get; internal set; }
  /// <summary>Of the plan that is there, "" for none.</summary>
  public string Digest { get; internal set; } = "";
  /// <summary>The robot was seen to run it.</summary>
  public bool Running { get; internal set; }
  /// <summary>The last within reach that the robot follows; null but in the mode follow.</summary>
  public Targets Following { get; internal set; }
  /// <summary>One line for the user, "" for none.</summary>
  public string Notice { get; internal set; } = "";

  /// <summary>At the start, the hands as yet unseen.</summary>
  public State(Hand left, Hand right) {
    Left = left;
    Right = right;
  }

  internal State Copy() => (State)MemberwiseClone();

  /// <summary>0 the left one, 1 the right.</summary>
  internal Hand HandOf(int index) => index == 0 ? Left : Right;

  internal void SetHand(int index, Hand hand) {
    if (index == 0) {
      Left = hand;
    } else {
      Right = hand;
    }
  }

  /// <summary>Whether a button went down at this step, on either hand.</summary>
  internal bool Presses(Buttons one) => Left.Presses(one) || Right.Presses(one);

  /// <summary>Whether a grip is held, without which the robot never moves.</summary>
  public bool Gripped => Left.Grips || Right.Grips;

  /// <summary>Whether all grips and triggers are let go.</summary>
  public bool Idle => ((Left.Held | Right.Held) & (Buttons.Grip | Buttons.Trigger)) == 0;

  /// <summary>The targets of so many <paramref name="seconds"/> ago; null where there are none as old.</summary>
  public Targets Before(double seconds) {
    if (Stamp == null) {
      return null;
    }
    for (int i = History.Count - 1; i >= 0; i--) {
      if (History[i].Stamp <= Stamp.Value - seconds) {
        return History[i].Targets;
      }
    }
    return null;
  }

  // The history from `first` on, and `also` where it is one.
  internal IReadOnlyList<Remembered> HistoryFrom(int first, Remembered? also = null) {
    int kept = Math.Max(History.Count - first, 0);
    var found = new Remembered[kept + (also == null ? 0 : 1)];
    for (int i = 0; i < kept; i++) {
      found[i] = History[first + i];
    }
    if (also != null) {
      found[kept] = also.Value;
    }
    return found;
  }
}
}
