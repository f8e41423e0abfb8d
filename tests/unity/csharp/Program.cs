// Tests the package's C# core by the shared vectors of a package's folder:
//
//   mono vectors.exe FOLDER [--more FILE] [--time]
//
// FILE has cases of what the shared vectors leave out, in the same form. It prints a line a file, and ends with exit
// code 1 and one line at the first disagreement, or where the package is not sound.

using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Globalization;
using System.IO;
using Trunkline;
using static Messages;

internal static class Program {
  private const int _calls = 2000;  // that are timed, after as many that are not

  public static int Main(string[] given) {
    CultureInfo.DefaultThreadCurrentCulture = CultureInfo.CurrentCulture = CultureInfo.GetCultureInfo("de-DE");
    try {
      string more = null;
      bool time = false;
      for (int i = 1; i < given.Length; i++) {
        time |= given[i] == "--time";
        more = given[i] == "--more" ? given[++i] : more;
      }
      new Vectors(FilesIn(given[0])).Test(more, time);
      return 0;
    } catch (InputError error) {
      Console.WriteLine($"error: {error.Message}");
      return 1;
    }
  }

  private static Dictionary<string, byte[]> FilesIn(string folder) {
    var files = new Dictionary<string, byte[]>();
    foreach (string path in Directory.GetFiles(folder, "*", SearchOption.AllDirectories)) {
      files[path.Substring(folder.Length).TrimStart('/')] = File.ReadAllBytes(path);
    }
    return files;
  }

  /// <summary>A network that answers what was recorded, and keeps what it was asked.</summary>
  private sealed class Recorded : INetwork {
    public Dictionary<string, float[]> Answers;
    public float[] Asked;

    public int Inputs { get; set; }

    public IReadOnlyList<int> Outputs { get; set; }

    public IReadOnlyDictionary<string, float[]> Run(float[] poses, int count) {
      Asked = poses;
      return Answers;
    }
  }

  private sealed class Vectors {
    private readonly Dictionary<string, byte[]> _files;
    private readonly Dictionary<string, object> _steps;
    private readonly Teleoperation _core;
    private readonly Recorded _network;
    private readonly ArmKinematics _kinematics;

    public Vectors(Dictionary<string, byte[]> files) {
      _files = files;
      Unpacked.PackageDigest(files);
      _steps = Block(Read("Tests/Vectors/steps.json"));
      _core = new Teleoperation(Teleop.Read(new JsonBlock(_steps["settings"], "settings")), Unpacked.MapsOf(files),
                                (string)_steps["package"], (double)_steps["mount_offset"]);
      var block = Block(Block(Read("Runtime/manifest.json"))["network"]);
      int tendons = List(block["output_order"]).Count;
      _network = new Recorded {
        Inputs = List(block["input_order"]).Count, Outputs = new[] { tendons, tendons, 3 },
      };
      _kinematics = Unpacked.KinematicsOf(files, _network);
    }

    private object Read(string path) {
      if (!_files.ContainsKey(path)) {
        throw new InputError($"{path}: no such file, expected the shared vectors of a package");
      }
      return Json.Read(_files[path], path);
    }

    public void Test(string more, bool time) {
      Cases("alignment", AnswerAlignment);
      Cases("rigid_reach", AnswerRigid);
      Cases("soft_reach", AnswerSoft);
      Cases("targets", AnswerTargets);
      Cases("network", AnswerNetwork);
      Steps();
      if (more != null) {
        More(Block(Json.Read(File.ReadAllBytes(more), more)));
      }
      if (time) {
        Time();
      }
    }

    private static void Say(string name, int count, Comparison comparison) => Console.WriteLine(string.Format(
        CultureInfo.InvariantCulture, "{0,-12} {1,4} cases {2,6} numbers, greatest deviation {3:0.0e+00}", name, count,
        comparison.Numbers, comparison.Greatest));

    private void Cases(string name, Func<Dictionary<string, object>, Dictionary<string, object>, object> answer) {
      var cases = List(Block(Read($"Tests/Vectors/{name}.json"))["cases"]);
      Cases(name, cases, answer);
    }

    private static void Cases(string name, List<object> cases,
                              Func<Dictionary<string, object>, Dictionary<string, object>, object> answer) {
      var comparison = new Comparison();
      for (int i = 0; i < cases.Count; i++) {
        var one = Block(cases[i]);
        comparison.Of($"{name}[{i}]", one["answer"], answer(Block(one["question"]), Block(one["answer"])));
      }
      Say(name, cases.Count, comparison);
    }

    private void Steps() {
      var comparison = new Comparison();
      int count = 0;
      foreach (object sequence in List(_steps["sequences"])) {
        var state = _core.Start();
        var steps = List(Block(sequence)["steps"]);
        for (int i = 0; i < steps.Count; i++, count++) {
          var step = Block(steps[i]);
          var (next, intent) = _core.Step(state, Input(step["input"]), Number(step["dt"]));
          comparison.Of($"steps: {Block(sequence)["name"]}[{i}]", step["intent"], Json(intent));
          var again = _core.Step(state, Input(step["input"]), Number(step["dt"])).Intent;
          comparison.Of($"steps: {Block(sequence)["name"]}[{i}] once more", Json(intent), Json(again));
          state = next;
        }
      }
      Say("steps", count, comparison);
    }

    // --- what answers

    private object AnswerAlignment(Dictionary<string, object> asked, Dictionary<string, object> expected) {
      var wrist = Alignment.WristOf(Numbers(asked["joints"]), _core.MountOffset);
      var found = Alignment.Align(Vector(asked["tip"]), Vector(asked["mount"]), Vector(asked["pointing"]), wrist,
                                  Aligned(asked["last"]), _core.Settings.BendingPlane);
      return new Dictionary<string, object> { ["wrist"] = Json(wrist), ["aligned"] = Json(found) };
    }

    private object AnswerRigid(Dictionary<string, object> asked, Dictionary<string, object> expected) =>
        Json(_core.Reach.Rigid(Vector(asked["mount"]), Vector(asked["pointing"])));

    private object AnswerSoft(Dictionary<string, object> asked, Dictionary<string, object> expected) =>
        Json(_core.Reach.Soft(Vector(asked["tip"]), Vector(asked["gravity"])));

    private object AnswerTargets(Dictionary<string, object> asked, Dictionary<string, object> expected) {
      var wrist = Alignment.WristOf(Numbers(asked["joints"]), _core.MountOffset);
      var things = asked.ContainsKey("things") ? asked["things"] : new List<object>();
      var world = World(new Dictionary<string, object> {
        ["digest"] = "world", ["boxes"] = asked["boxes"], ["things"] = things,
      });
      var pointing = Vector(asked["pointing"]);
      return world.Held != null
          ? Json(Placing.Bring(world.Held, Vector(asked["rigid"]), pointing, false, wrist, 1, world, _core.Reach))
          : Json(Placing.Place(Vector(asked["rigid"]), Vector(asked["tip"]), pointing, false, wrist,
                               Aligned(asked["last"]), world, _core.Reach, _core.Settings));
    }

    private object AnswerNetwork(Dictionary<string, object> asked, Dictionary<string, object> expected) {
      Record(expected);
      var found = _kinematics.Ask(Numbers(asked["pose"]));
      CompareAsked(new List<object> { asked["pose"] });
      return Json(found);
    }

    private object AnswerBend(Dictionary<string, object> asked, Dictionary<string, object> expected) {
      Record(Block(asked["network"]));
      var found = _kinematics.Bend(Vector(asked["tip"]), Vector(asked["gravity"]), (double)asked["tolerance"]);
      CompareAsked(List(asked["poses"]));
      var told = Json(found);
      told.Remove("doubtful");
      return told;
    }

    private void Record(Dictionary<string, object> answers) {
      _network.Answers = new Dictionary<string, float[]>();
      foreach (string name in new[] { "commands", "lengths", "tip" }) {
        _network.Answers[name] = Array.ConvertAll(Numbers(answers[name]), number => (float)number);
      }
    }

    private void CompareAsked(List<object> poses) {
      var expected = new List<object>();
      foreach (object pose in poses) {
        expected.AddRange(List(pose));
      }
      var comparison = new Comparison();
      comparison.Of("network: what it was asked", expected, Json(Array.ConvertAll(_network.Asked, one => (double)one)));
    }

    // --- what the shared vectors leave out

    private void More(Dictionary<string, object> more) {
      Cases("frames", List(more["frames"]), AnswerFrames);
      Cases("fit", List(more["fit"]), AnswerFit);
      Cases("bend", List(more["bend"]), AnswerBend);
      Cases("things", List(more["things"]), AnswerTargets);
      Cases("refusals", List(more["refusals"]), AnswerRefused);
    }

    private static object AnswerFrames(Dictionary<string, object> asked, Dictionary<string, object> expected) {
      var position = Vector(asked["position"]);
      var turn = Quaternion(asked["quaternion"]);
      var spin = Vector(asked["spin"]);
      var there = Frames.UnityQuaternion(turn);
      Require(Frames.UnityPosition(Frames.UnityPosition(position)) == position, "positions there and back");
      Require(Frames.UnityQuaternion(there) == turn, "rotations there and back");
      Require(Frames.UnityAngularVelocity(Frames.UnityAngularVelocity(spin)) == spin, "spins there and back");
      return new Dictionary<string, object> {
        ["position"] = Json(Frames.UnityPosition(position)),
        ["quaternion"] = Json(new[] { there.X, there.Y, there.Z, there.W }),
        ["spin"] = Json(Frames.UnityAngularVelocity(spin)),
      };
    }

    private static object AnswerFit(Dictionary<string, object> asked, Dictionary<string, object> expected) {
      List<Vector> reference = Messages.Vectors(asked["reference"]), robotBase = Messages.Vectors(asked["base"]);
      var pose = robotBase.Count > 3 ? Aligning.Fit(reference, robotBase) : Aligning.FitThree(reference, robotBase);
      return new Dictionary<string, object> {
        ["pose"] = Json(pose),
        ["inverse"] = Json(Aligning.Inverse(pose)),
        ["after"] = Json(Aligning.After(pose, pose)),
        ["residuals"] = Json(Aligning.Residuals(pose, reference, robotBase)),
        ["expected_error"] = Aligning.ExpectedError(pose, reference, robotBase, Vector(asked["at"])),
        ["tilt"] = Aligning.Tilt(pose),
      };
    }

    private object AnswerRefused(Dictionary<string, object> asked, Dictionary<string, object> expected) {
      try {
        switch ((string)asked["of"]) {
          case "rigid_reach": AnswerRigid(asked, null); break;
          case "soft_reach": AnswerSoft(asked, null); break;
          case "fit": AnswerFit(asked, null); break;
          case "network": _kinematics.Ask(Numbers(asked["pose"])); break;
          case "bend": AnswerBend(asked, null); break;
          default: Unpacked.KinematicsOf(_files, new Recorded { Inputs = 7, Outputs = new[] { 3, 3, 3 } }); break;
        }
      } catch (InputError error) {
        return new Dictionary<string, object> { ["says"] = error.Message };
      }
      throw new InputError($"{asked["of"]}: found no refusal, expected: {expected["says"]}");
    }

  

    private static void Require(bool holds, string what) {
      if (!holds) {
        throw new InputError($"{what}: found another, expected the same");
      }
    }

    // --- how long it takes

    private void Time() {
      foreach (string name in new[] { "rigid_reach", "soft_reach" }) {
        var cases = List(Block(Read($"Tests/Vectors/{name}.json"))["cases"]);
        var asked = cases.ConvertAll(one => Block(Block(one)["question"]));
        bool rigid = name == "rigid_reach";
        var points = asked.ConvertAll(one => Vector(one[rigid ? "mount" : "tip"]));
        var directions = asked.ConvertAll(one => Vector(one[rigid ? "pointing" : "gravity"]));
        int count = points.Count;
        if (rigid) {
          Timed("rigid_reach", i => _core.Reach.Rigid(points[i % count], directions[i % count]));
        } else {
          Timed("soft_reach, gravity stands still", i => _core.Reach.Soft(points[i % count], directions[0]));
          Timed("soft_reach, gravity turns", i => _core.Reach.Soft(points[i % count], directions[i % count]));
        }
      }
      foreach (object sequence in List(_steps["sequences"])) {
        string name = (string)Block(sequence)["name"];
        if (name != "reach" && name != "tremble") {
          continue;
        }
        var steps = List(Block(sequence)["steps"]);
        var inputs = steps.ConvertAll(one => Input(Block(one)["input"]));
        var state = _core.Start();
        Timed($"step of `{name}`", i => {
          state = i % inputs.Count == 0 ? _core.Start() : state;
          state = _core.Step(state, inputs[i % inputs.Count], Number(Block(steps[i % inputs.Count])["dt"])).State;
        });
      }
    }

    private static void Timed(string name, Action<int> call) {
      var took = new double[_calls];
      for (int i = 0; i < 2 * _calls; i++) {
        long before = Stopwatch.GetTimestamp();
        call(i);
        took[i % _calls] = 1e6 * (Stopwatch.GetTimestamp() - before) / Stopwatch.Frequency;
      }
      Array.Sort(took);
      string words = "{0}: {1:0.0} µs median, {2:0.0} µs 95th percentile";
      double half = took[_calls / 2], most = took[_calls * 95 / 100];
      Console.WriteLine(string.Format(CultureInfo.InvariantCulture, words, name, half, most));
    }
  }
}
