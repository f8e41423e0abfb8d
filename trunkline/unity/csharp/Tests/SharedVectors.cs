using System;
using System.Collections.Generic;
using System.Globalization;

namespace Trunkline.Tests {
using static Messages;

/// <summary>A network that answers what was recorded, and keeps what it was asked.</summary>
internal sealed class Recorded : INetwork {
  public Dictionary<string, float[]> Answers;
  public float[] Asked;

  public int Inputs { get; set; }

  public IReadOnlyList<int> Outputs { get; set; }

  public IReadOnlyDictionary<string, float[]> Run(float[] poses, int count) {
    Asked = poses;
    return Answers;
  }
}

/// <summary>The core beside the shared vectors of a package, its contents by path. Unity's test runner and the program
/// that tests the core without Unity both run this.</summary>
internal sealed class SharedVectors {
  /// <summary>Files of Tests/Vectors, without their ending.</summary>
  public static readonly string[] Names = { "alignment", "rigid_reach", "soft_reach", "targets", "network", "steps" };

  public readonly Teleoperation Core;
  public readonly ArmKinematics Kinematics;

  private readonly IReadOnlyDictionary<string, byte[]> _files;
  private readonly Dictionary<string, object> _steps;
  private readonly Recorded _network;

  public SharedVectors(IReadOnlyDictionary<string, byte[]> files) {
    _files = files;
    _steps = Block(Read("Tests/Vectors/steps.json"));
    var manifest = Unpacked.ManifestOf(files);
    Core = new Teleoperation(Teleop.Read(new JsonBlock(_steps["settings"], "settings")),
                             Unpacked.MapsOf(files, manifest), (string)_steps["package"],
                             (double)_steps["mount_offset"]);
    var block = manifest.Block("network");
    int tendons = block.Texts("output_order").Length;
    _network = new Recorded {
      Inputs = block.Texts("input_order").Length, Outputs = new[] { tendons, tendons, 3 },
    };
    Kinematics = Unpacked.KinematicsOf(manifest, _network);
  }

  private object Read(string path) {
    if (!_files.ContainsKey(path)) {
      throw new InputError($"{path}: no such file, expected the shared vectors of a package");
    }
    return Json.Read(_files[path], path);
  }

  /// <summary>How many cases and numbers there were.</summary>
  /// <exception cref="InputError">Naming the first disagreement.</exception>
  public string Test(string name) {
    switch (name) {
      case "alignment": return Cases(name, CasesOf(name), AnswerAlignment);
      case "rigid_reach": return Cases(name, CasesOf(name), AnswerRigid);
      case "soft_reach": return Cases(name, CasesOf(name), AnswerSoft);
      case "targets": return Cases(name, CasesOf(name), AnswerTargets);
      case "network": return Cases(name, CasesOf(name), AnswerNetwork);
      default: return Steps();
    }
  }

  /// <summary>Of one file: each has a question and an answer.</summary>
  internal List<object> CasesOf(string name) => List(Block(Read($"Tests/Vectors/{name}.json"))["cases"]);

  internal List<object> Sequences => List(_steps["sequences"]);

  internal static string Cases(string name, List<object> cases,
                              Func<Dictionary<string, object>, Dictionary<string, object>, object> answer) {
    var comparison = new Comparison();
    for (int i = 0; i < cases.Count; i++) {
      var one = Block(cases[i]);
      comparison.Of($"{name}[{i}]", one["answer"], answer(Block(one["question"]), Block(one["answer"])));
    }
    return Said(name, cases.Count, comparison);
  }

  private string Steps() {
    var comparison = new Comparison();
    int count = 0;
    foreach (object sequence in Sequences) {
      var state = Core.Start();
      var steps = List(Block(sequence)["steps"]);
      for (int i = 0; i < steps.Count; i++, count++) {
        var step = Block(steps[i]);
        var (next, intent) = Core.Step(state, Input(step["input"]), Number(step["dt"]));
        comparison.Of($"steps: {Block(sequence)["name"]}[{i}]", step["intent"], Json(intent));
        var again = Core.Step(state, Input(step["input"]), Number(step["dt"])).Intent;
        comparison.Of($"steps: {Block(sequence)["name"]}[{i}] once more", Json(intent), Json(again));
        state = next;
      }
    }
    return Said("steps", count, comparison);
  }

  private static string Said(string name, int count, Comparison comparison) => string.Format(
      CultureInfo.InvariantCulture, "{0,-12} {1,4} cases {2,6} numbers, greatest deviation {3:0.0e+00}", name, count,
      comparison.Numbers, comparison.Greatest);

  // --- what answers

  internal object AnswerAlignment(Dictionary<string, object> asked, Dictionary<string, object> expected = null) {
    var wrist = Alignment.WristOf(Numbers(asked["joints"]), Core.MountOffset);
    var found = Alignment.Align(Vector(asked["tip"]), Vector(asked["mount"]), Vector(asked["pointing"]), wrist,
                                Aligned(asked["last"]), Core.Settings.BendingPlane);
    return new Dictionary<string, object> { ["wrist"] = Json(wrist), ["aligned"] = Json(found) };
  }

  internal object AnswerRigid(Dictionary<string, object> asked, Dictionary<string, object> expected = null) =>
      Json(Core.Reach.Rigid(Vector(asked["mount"]), Vector(asked["pointing"])));

  internal object AnswerSoft(Dictionary<string, object> asked, Dictionary<string, object> expected = null) =>
      Json(Core.Reach.Soft(Vector(asked["tip"]), Vector(asked["gravity"])));

  internal object AnswerTargets(Dictionary<string, object> asked, Dictionary<string, object> expected = null) {
    var wrist = Alignment.WristOf(Numbers(asked["joints"]), Core.MountOffset);
    var things = asked.ContainsKey("things") ? asked["things"] : new List<object>();
    var world = World(new Dictionary<string, object> {
      ["digest"] = "world", ["boxes"] = asked["boxes"], ["things"] = things,
    });
    var pointing = Vector(asked["pointing"]);
    return world.Held != null
        ? Json(Placing.Bring(world.Held, Vector(asked["rigid"]), pointing, false, wrist, 1, world, Core.Reach))
        : Json(Placing.Place(Vector(asked["rigid"]), Vector(asked["tip"]), pointing, false, wrist,
                             Aligned(asked["last"]), world, Core.Reach, Core.Settings));
  }

  internal object AnswerNetwork(Dictionary<string, object> asked, Dictionary<string, object> expected = null) {
    Record(expected);
    var found = Kinematics.Ask(Numbers(asked["pose"]));
    CompareAsked(new List<object> { asked["pose"] });
    return Json(found);
  }

  internal void Record(Dictionary<string, object> answers) {
    _network.Answers = new Dictionary<string, float[]>();
    foreach (string name in new[] { "commands", "lengths", "tip" }) {
      _network.Answers[name] = Array.ConvertAll(Numbers(answers[name]), number => (float)number);
    }
  }

  internal void CompareAsked(List<object> poses) {
    var expected = new List<object>();
    foreach (object pose in poses) {
      expected.AddRange(List(pose));
    }
    var comparison = new Comparison();
    comparison.Of("network: what it was asked", expected, Json(Array.ConvertAll(_network.Asked, one => (double)one)));
  }
}
}
