using System;
using System.Collections.Generic;

namespace Trunkline.Tests {

/// <summary>The core's messages from JSON and as JSON, by the names that Python has.</summary>
internal static class Messages {
  public static Dictionary<string, object> Block(object given) => (Dictionary<string, object>)given;

  public static List<object> List(object given) => (List<object>)given;

  public static double Number(object given) => given == null ? double.NaN : (double)given;

  public static double[] Numbers(object given) => List(given).ConvertAll(Number).ToArray();

  public static Vector Vector(object given) {
    var at = Numbers(given);
    return new Vector(at[0], at[1], at[2]);
  }

  public static List<Vector> Vectors(object given) => List(given).ConvertAll(Vector);

  public static Quaternion Quaternion(object given) {
    var at = Numbers(given);
    return new Quaternion(at[0], at[1], at[2], at[3]);
  }

  public static Pose Pose(object given) => given == null ? null
      : new Pose(Vector(Block(given)["position"]), Quaternion(Block(given)["quaternion"]));

  public static Aligned Aligned(object given) {
    var block = Block(given);
    return new Aligned((double)block["heading"], (int)(double)block["half_plane"], (double?)block["turned"]);
  }

  public static Box Box(object given) {
    var block = Block(given);
    return new Box((string)block["name"], Vector(block["low"]), Vector(block["high"]));
  }

  public static Input Input(object given) {
    var block = Block(given);
    return new Input(
        Number(block["stamp"]), Controller(block["left"]), Controller(block["right"]), Pose(block["alignment"]),
        Numbers(block["joints"]), World(block["world"]), (string)block["package"], Plan(block["plan"]),
        (string)block["shown"], Executor(block["executor"]), Offer(block["offer"]));
  }

  private static Controller Controller(object given) {
    var block = Block(given);
    var stick = Numbers(block["stick"]);
    return new Controller(
        Vector(block["position"]), Quaternion(block["quaternion"]), (bool)block["tracked"], (bool)block["trigger"],
        (bool)block["grip"], stick[0], stick[1], (bool)block["stick_pressed"], (bool)block["primary"],
        (bool)block["secondary"]);
  }

  public static World World(object given) {
    var block = Block(given);
    return new World((string)block["digest"], List(block["boxes"]).ConvertAll(Box),
                     List(block["things"]).ConvertAll(Thing));
  }

  private static Thing Thing(object given) {
    Dictionary<string, object> block = Block(given), basket = Block(block["basket"]);
    return new Thing(
        (string)block["name"], Word<Shape>(block["shape"]), Number(block["diameter"]), Number(block["height"]),
        Number(block["mass"]), Vector(block["position"]), Quaternion(block["quaternion"]),
        Word<Support>(block["support"]),
        new Basket(Number(basket["width"]), Number(basket["length"]), Number(basket["rise"])));
  }

  private static PlanReport Plan(object given) {
    if (given == null) {
      return null;
    }
    var block = Block(given);
    return new PlanReport((int)(double)block["serial"], (string)block["digest"], (string)block["refused"],
                          (string)block["package"], (string)block["world"]);
  }

  private static ExecutorReport Executor(object given) {
    var block = Block(given);
    return new ExecutorReport(Word<ExecutorMode>(block["mode"]), (string)block["digest"], (string)block["fault"]);
  }

  private static Offer Offer(object given) {
    if (given == null) {
      return null;
    }
    var block = Block(given);
    return new Offer((string)block["thing"], Vector(block["rigid"]), Vector(block["pointing"]),
                     Number(block["probability"]));
  }

  private static T Word<T>(object given) => (T)Enum.Parse(typeof(T), (string)given, true);

  // --- as JSON

  public static object Json(Enum word) => word.ToString().ToLowerInvariant();

  public static object Json(double? number) =>
      number == null || double.IsNaN(number.Value) || double.IsInfinity(number.Value) ? null : (object)number.Value;

  public static List<object> Json(IEnumerable<double> numbers) {
    var found = new List<object>();
    foreach (double number in numbers) {
      found.Add(Json(number));
    }
    return found;
  }

  public static List<object> Json(Vector at) => Json(new[] { at.X, at.Y, at.Z });

  public static object Json(Vector? at) => at == null ? null : Json(at.Value);

  public static List<object> Json(Quaternion q) => Json(new[] { q.W, q.X, q.Y, q.Z });

  public static Dictionary<string, object> Json(Pose pose) => new Dictionary<string, object> {
    ["position"] = Json(pose.Position), ["quaternion"] = Json(pose.Quaternion),
  };

  public static Dictionary<string, object> Json(Reading reading) => new Dictionary<string, object> {
    ["where"] = Json(reading.Where), ["outside_by"] = Json(reading.OutsideBy), ["offer"] = Json(reading.Offer),
  };

  public static Dictionary<string, object> Json(Aligned aligned) => new Dictionary<string, object> {
    ["heading"] = Json(aligned.Heading), ["half_plane"] = (double)aligned.HalfPlane, ["turned"] = Json(aligned.Turned),
  };

  public static Dictionary<string, object> Json(Answer answer) => new Dictionary<string, object> {
    ["commands"] = Json(answer.Commands), ["lengths"] = Json(answer.Lengths), ["tip"] = Json(answer.Tip),
    ["doubtful"] = answer.Doubtful, ["unsure"] = answer.Unsure,
  };

  public static Dictionary<string, object> Json(Wrist wrist) => new Dictionary<string, object> {
    ["position"] = Json(wrist.Position), ["pointing"] = Json(wrist.Pointing), ["heading"] = Json(wrist.Heading),
    ["angle"] = Json(wrist.Angle),
  };

  private static Dictionary<string, object> Json(Target target) => new Dictionary<string, object> {
    ["position"] = Json(target.Position), ["reach"] = Json(target.Reach), ["outside_by"] = Json(target.OutsideBy),
    ["offer"] = Json(target.Offer), ["solid"] = target.Solid,
  };

  private static Dictionary<string, object> Json(Offer offer) => offer == null ? null : new Dictionary<string, object> {
    ["thing"] = offer.Thing, ["rigid"] = Json(offer.Rigid), ["pointing"] = Json(offer.Pointing),
    ["probability"] = Json(offer.Probability),
  };

  public static Dictionary<string, object> Json(Targets targets) =>
      targets == null ? null : new Dictionary<string, object> {
        ["rigid"] = Json(targets.Rigid), ["tip"] = Json(targets.Tip), ["pointing"] = Json(targets.Pointing),
        ["heading"] = Json(targets.Heading), ["half_plane"] = (double)targets.HalfPlane,
        ["turned"] = Json(targets.Turned), ["tilt_limited"] = targets.TiltLimited, ["thing"] = targets.Thing,
        ["better"] = Json(targets.Better),
      };

  private static Dictionary<string, object> Json(Request request) =>
      request == null ? null : new Dictionary<string, object> {
        ["serial"] = (double)request.Serial, ["targets"] = Json(request.Targets), ["world"] = request.World,
        ["package"] = request.Package,
      };

  public static Dictionary<string, object> Json(Intent intent) => new Dictionary<string, object> {
    ["mode"] = Json(intent.Mode), ["motion"] = Json(intent.Motion), ["notice"] = intent.Notice,
    ["targets"] = Json(intent.Targets), ["rays"] = new List<object> { Json(intent.LeftRay), Json(intent.RightRay) },
    ["request"] = Json(intent.Request), ["preview"] = intent.Preview, ["execute"] = intent.Execute,
    ["countdown"] = Json(intent.Countdown), ["follow"] = Json(intent.Follow),
  };
}
}
