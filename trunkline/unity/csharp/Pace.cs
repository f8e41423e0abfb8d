// The time step, and whether a device keeps up with it. Nothing of Unity's is used here.

using System;

namespace Trunkline {

// Whole steps a frame of the display, as few as keep each short enough: so every frame shows the arm after as many
// steps as the last, and nothing judders. Python: trunkline/unity/pace.py.
public static class Pace {

  private const double _exact = 1e-9;  // share by which a step may be longer: of rounding
  private const double _usual = 60;  // Hz, of a display that does not say its rate

  // The least number of steps in a frame of a display of `rate` Hz of which none is longer than `longest` s.
  public static int StepsPerFrame(double rate, double longest) {
    return Math.Max(1, (int)Math.Ceiling(1 / (Known(rate) * longest) * (1 - _exact)));
  }

  // The length of each of them, s.
  public static double Step(double rate, double longest) {
    return 1 / (Known(rate) * StepsPerFrame(rate, longest));
  }

  // The rate itself, Hz, if it is one.
  public static double Known(double rate) {
    return rate > 0 && !double.IsInfinity(rate) ? rate : _usual;
  }
}

// Simulated time against real time, a second at a time.
public class KeepUp {

  private const double _window = 1;  // s of real time, over which the share is taken
  private const double _enough = 0.95;  // of it, of two windows one after the other: one that stalls is no slow device

  private double _real, _simulated, _before = 1;

  // The share of real time that was simulated in the last whole window, 1 before the first.
  public double Share { get; private set; } = 1;

  // Whether the simulation falls behind.
  public bool Behind => Math.Max(Share, _before) < _enough;

  // One frame: seconds that have passed and that were simulated. True when a window is full and `Share` is new.
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

  // Begin a window anew, as after a pause.
  public void Restart() {
    _real = 0;
    _simulated = 0;
  }

  // What to tell, at most a line.
  public static string Warning(double share, double step) {
    return $"Trunkline: found {100 * share:F0} % of real time simulated in steps of {1000 * step:F1} ms, expected "
        + "100 %: this device does not keep up, the arm moves too slowly";
  }
}
}
