using System;
using static System.FormattableString;

namespace Trunkline {

/// <summary>The time step: whole steps a frame of the display, as few as keep each short enough, so that every frame
/// shows the arm after as many steps as the last, and nothing judders. Nothing of Unity's is used here. Python:
/// trunkline/unity/time_steps.py.</summary>
public static class Pace {

  private const double _exact = 1e-9;  // share by which a step may be longer: of rounding
  private const double _usual = 60;  // Hz, of a display that does not say its rate

  /// <summary>The least number of steps in a frame of a display of `rate` Hz of which none is longer than `longest`
  /// s.</summary>
  public static int StepsPerFrame(double rate, double longest) {
    return Math.Max(1, (int)Math.Ceiling(1 / (Known(rate) * longest) * (1 - _exact)));
  }

  /// <summary>The length of each of them, s.</summary>
  public static double Step(double rate, double longest) {
    return 1 / (Known(rate) * StepsPerFrame(rate, longest));
  }

  /// <summary>The rate itself, Hz, if it is one.</summary>
  public static double Known(double rate) {
    return rate > 0 && !double.IsInfinity(rate) ? rate : _usual;
  }
}

/// <summary>Simulated time against real time, a second at a time: whether a device keeps up.</summary>
public class KeepUp {

  private const double _window = 1;  // s of real time, over which the share is taken
  private const double _enough = 0.95;  // of it, of two windows one after the other: one that stalls is no slow device

  private double _real, _simulated, _before = 1;

  /// <summary>The share of real time that was simulated in the last whole window, 1 before the first.</summary>
  public double Share { get; private set; } = 1;

  /// <summary>Whether the simulation falls behind.</summary>
  public bool Behind => Math.Max(Share, _before) < _enough;

  /// <summary>One frame: seconds that have passed and that were simulated. True when a window is full and `Share` is
  /// new.</summary>
  public bool Add(double real, double simulated) {
    _real += real;
    _simulated += simulated;
    if (_real < _window) {
      return false;
    }
    _before = Share;
    Share = _simulated / _real;
    Restart();
    return true;
  }

  /// <summary>Begin a window anew, as after a pause.</summary>
  public void Restart() {
    _real = 0;
    _simulated = 0;
  }

  /// <summary>What to tell, at most a line.</summary>
  public static string Warning(double share, double step) {
    return Invariant($"Trunkline: found {100 * share:F0} % of real time simulated in steps of {1000 * step:F1} ms, ")
        + "expected 100 %: this device does not keep up, the arm moves too slowly";
  }
}
}
