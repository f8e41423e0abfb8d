using System;
using System.Collections.Generic;

namespace Trunkline.Tests {
using static Messages;

/// <summary>Cases of what the shared vectors leave out, in the same form.</summary>
internal sealed class More {
  private readonly Dictionary<string, byte[]> _files;
  private readonly SharedVectors _shared;

  public More(Dictionary<string, byte[]> files, SharedVectors shared) {
    _files = files;
    _shared = shared;
  }

  public void Test(Dictionary<string, object> more) {
    Say("frames", more["frames"], AnswerFrames);
    Say("fit", more["fit"], AnswerFit);
    Say("bend", more["bend"], AnswerBend);
    Say("sure", more["sure"], AnswerSure);
    Say("things", more["things"], _shared.AnswerTargets);
    Say("reach", more["reach"], _shared.AnswerSoft);
    Say("refusals", more["refusals"], AnswerRefused);
  }

  private static void Say(string name, object cases,
                          Func<Dictionary<string, object>, Dictionary<string, object>, object> answer) =>
      Console.WriteLine(SharedVectors.Cases(name, List(cases), answer));

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
    var pose = Fitted(reference, robotBase);
    return new Dictionary<string, object> {
      ["pose"] = Json(pose),
      ["inverse"] = Json(Aligning.Inverse(pose)),
      ["after"] = Json(Aligning.After(pose, pose)),
      ["residuals"] = Json(Aligning.Residuals(pose, reference, robotBase)),
      ["expected_error"] = Aligning.ExpectedError(pose, reference, robotBase, Vector(asked["at"])),
      ["tilt"] = Aligning.Tilt(pose),
    };
  }

  private static Pose Fitted(List<Vector> reference, List<Vector> robotBase) =>
      robotBase.Count > 3 ? Aligning.Fit(reference, robotBase) : Aligning.FitThree(reference, robotBase);

  private object AnswerBend(Dictionary<string, object> asked, Dictionary<string, object> expected) {
    _shared.Record(Block(asked["network"]));
    var found = _shared.Kinematics.Bend(Vector(asked["tip"]), Vector(asked["gravity"]), (double)asked["tolerance"]);
    _shared.CompareAsked(List(asked["poses"]));
    Require(_shared.Kinematics.TryBend(Vector(asked["tip"]), Vector(asked["gravity"]), (double)asked["tolerance"],
                                       out var again) && again.Tip == found.Tip, "the answer without an exception");
    var told = Json(found);
    told.Remove("doubtful");
    told.Remove("unsure");
    told["pulls"] = Json(_shared.Kinematics.PullsOf(found));
    return told;
  }

  private static object AnswerSure(Dictionary<string, object> asked, Dictionary<string, object> expected) {
    double[] pose = Numbers(asked["pose"]), limits = Numbers(asked["sure"]), straight = Numbers(asked["straight"]);
    var commands = Array.ConvertAll(Numbers(asked["commands"]), number => (float)number);
    var network = new Recorded {
      Inputs = pose.Length, Outputs = new[] { straight.Length, straight.Length, 3 },
      Answers = new Dictionary<string, float[]> { ["commands"] = commands, ["lengths"] = commands, ["tip"] = new float[3] },
    };
    var arm = new ArmKinematics(network, new string[pose.Length], new string[straight.Length], straight, 1,
                                new Sure(limits[0], limits[1], limits[2]));
    return new Dictionary<string, object> { ["unsure"] = arm.Ask(pose).Unsure };
  }

  private object AnswerRefused(Dictionary<string, object> asked, Dictionary<string, object> expected) {
    try {
      switch ((string)asked["of"]) {
        case "rigid_reach": _shared.AnswerRigid(asked); break;
        case "soft_reach": _shared.AnswerSoft(asked); break;
        case "fit": Fitted(Messages.Vectors(asked["reference"]), Messages.Vectors(asked["base"])); break;
        case "network": _shared.Kinematics.Ask(Numbers(asked["pose"])); break;
        case "bend": AnswerBend(asked, null); break;
        default:
          Unpacked.KinematicsOf(Unpacked.ManifestOf(_files), new Recorded {
            Inputs = (int)Number(asked["inputs"]), Outputs = new[] { 3, 3, 3 },
          });
          break;
      }
    } catch (InputError error) {
      if ((string)asked["of"] == "bend" && List(asked["poses"]).Count > 0) {
        Require(!_shared.Kinematics.TryBend(Vector(asked["tip"]), Vector(asked["gravity"]), (double)asked["tolerance"],
                                            out var nearest), "a refusal without an exception");
        Require(nearest == null == error.Message.StartsWith("gravity: "), "the nearest answer where gravity is known");
      }
      return new Dictionary<string, object> { ["says"] = error.Message };
    }
    throw new InputError($"{asked["of"]}: found no refusal, expected: {expected["says"]}");
  }

  private static void Require(bool holds, string what) {
    if (!holds) {
      throw new InputError($"{what}: found another, expected the same");
    }
  }
}
}
