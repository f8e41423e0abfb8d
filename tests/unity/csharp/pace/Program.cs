// Prints what Pace and KeepUp say, for tests/unity/test_time_steps.py.

using System;
using System.Globalization;
using Trunkline;

public static class Program {

  // "step rate longest": steps a frame and their length. "keep real simulated, ...": after each frame, the share and
  // whether the simulation is behind.
  public static int Main(string[] arguments) {
    CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
    var numbers = Array.ConvertAll(arguments[1].Split(','), double.Parse);
    if (arguments[0] == "step") {
      Console.WriteLine($"{Pace.StepsPerFrame(numbers[0], numbers[1])} {Pace.Step(numbers[0], numbers[1]):R}");
      return 0;
    }
    var keepUp = new KeepUp();
    for (int i = 0; i < numbers.Length; i += 2) {
      bool told = keepUp.Add(numbers[i], numbers[i + 1]);
      Console.WriteLine($"{told} {keepUp.Share:R} {keepUp.Behind}");
    }
    CultureInfo.CurrentCulture = CultureInfo.GetCultureInfo("de-DE");  // whose decimals have a comma
    Console.WriteLine(KeepUp.Warning(keepUp.Share, 0.004));
    return 0;
  }
}
