using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Globalization;

namespace Trunkline.Tests {
using static Messages;

/// <summary>How long queries and steps take, µs. Each is asked in some rounds, between the others, and its least time
/// counts: what other programs take away is not of interest.</summary>
internal sealed class Timing {
  private const int _calls = 2000, _rounds = 8;
  private const double _goal = 50;  // µs, of a query

  private readonly Dictionary<string, byte[]> _files;
  private readonly SharedVectors _shared;

  public Timing(Dictionary<string, byte[]> files, SharedVectors shared) {
    _files = files;
    _shared = shared;
  }

  public void Tell() {
    var mounts = _shared.CasesOf("rigid_reach").ConvertAll(one => Block(Block(one)["question"]));
    Tell("reach of the mount", i => {
      var asked = mounts[i % mounts.Count];
      _shared.Core.Reach.Rigid(Vector(asked["mount"]), Vector(asked["pointing"]));
    });
    var reach = _shared.Core.Reach;
    var soft = _shared.CasesOf("soft_reach").ConvertAll(one => Block(Block(one)["question"]));
    var tips = soft.ConvertAll(one => Vector(one["tip"]));
    var known = soft.ConvertAll(one => Vector(one["gravity"]));
    known.RemoveAll(gravity => reach.Soft(tips[0], gravity).Where == Where.Unknown);  // answered at once
    // Which tip comes with which gravity changes from round to round.
    Tell("reach of the tip, gravity stands still", i => reach.Soft(tips[i % tips.Count], known[0]));
    Tell("reach of the tip, gravity turns each time",
         i => reach.Soft(tips[(i + i / known.Count) % tips.Count], known[i % known.Count]));
    var grids = Unpacked.GridsOf(_files, Unpacked.ManifestOf(_files));  // as packages for gravity of one tilt have it
    Tell("the same by grids, gravity tilts each time", i => {
      double tilt = i % 100 * 0.01;
      grids.Read(tips[i % tips.Count], new Vector(Math.Sin(tilt), 0, -Math.Cos(tilt)));
    });
    foreach (object sequence in _shared.Sequences) {
      string name = (string)Block(sequence)["name"];
      if (name != "reach" && name != "tremble") {
        continue;
      }
      var steps = List(Block(sequence)["steps"]);
      var inputs = steps.ConvertAll(one => Input(Block(one)["input"]));
      var times = steps.ConvertAll(one => Number(Block(one)["dt"]));
      var state = _shared.Core.Start();
      Tell($"step of the core, sequence `{name}`", i => {
        state = _shared.Core.Step(i == 0 ? _shared.Core.Start() : state, inputs[i], times[i]).State;
      }, inputs.Count);
    }
  }

  private static void Tell(string name, Action<int> call, int calls = _calls) {
    var took = new double[calls];
    for (int round = 0; round < _rounds; round++) {
      for (int i = 0; i < calls; i++) {
        long before = Stopwatch.GetTimestamp();
        call(i);
        double now = 1e6 * (Stopwatch.GetTimestamp() - before) / Stopwatch.Frequency;
        took[i] = round == 0 ? now : Math.Min(took[i], now);
      }
    }
    double sum = 0;
    int slow = 0;
    foreach (double one in took) {
      sum += one;
      slow += one > _goal ? 1 : 0;
    }
    Array.Sort(took);
    Console.WriteLine(string.Format(
        CultureInfo.InvariantCulture,
        "{0,-43} {1,5:0.0} µs mean {2,5:0.0} median {3,5:0.0} 95th percentile {4,6:0.0} max, {5,4:0.0} % above {6} of {7}",
        name, sum / calls, took[calls / 2], took[calls * 95 / 100], took[calls - 1], 100.0 * slow / calls, _goal,
        calls));
  }
}
}
