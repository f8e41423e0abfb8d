// Runs the package's components for Unity against stubs of Unity, MuJoCo's plug-in and the inference engine:
//
//   mono layer.exe FOLDER CASES
//
// FOLDER is a package; CASES has questions with Python's answers. It prints a line a part, and ends with exit code 1
// and one line at the first disagreement.

using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Reflection;
using NUnit.Framework;
using Trunkline.Samples;
using Unity.InferenceEngine;
using UnityEditor;
using UnityEditor.SceneManagement;
using UnityEngine;
using UnityEngine.Rendering;
using UnityEngine.XR;
using PackageInfo = UnityEditor.PackageManager.PackageInfo;

namespace Trunkline.Tests {
using static Messages;

internal static class Program {
  private const double _single = 2e-6;  // of numbers of 32 bits, and m

  private static Dictionary<string, object> _cases;
  private static int _offers, _mounts, _asked, _unready;

  public static int Main(string[] given) {
    PackageInfo.Folder = given[0];
    JsonUtility.Read = ReadAs.Text;
    try {
      _cases = Block(Json.Read(File.ReadAllBytes(given[1]), given[1]));
      Menu();
      Sample();
      Reach();
      Steps();
      Touches();
      Network();
      Refusals();
      ForTheTestRunner();
      return 0;
    } catch (InputError error) {
      Console.WriteLine($"error: {error.Message}");
      return 1;
    }
  }

  private static void Require(bool holds, string what) {
    if (!holds) {
      throw new InputError($"{what}: found another, expected so");
    }
  }

  private static void Compare(string where, object expected, object found) =>
      new Comparison(_single, _single).Of(where, expected, found);

  // What Unity calls by itself, also where it is not public.
  private static void Call(Component component, string name) => component.GetType().GetMethod(
      name, BindingFlags.Instance | BindingFlags.Public | BindingFlags.NonPublic).Invoke(component, null);

  private static T Awake<T>(T component) where T : Component {
    Call(component, "Awake");
    return component;
  }

  private static TextAsset Asset(string path) => CreateTwin.Asset(PackageInfo.FindForAssembly(null), path);

  // --- the menu entry, and the sample's

  private static void Menu() {
    var gravity = Physics.gravity;
    float step = Time.fixedDeltaTime;
    GraphicsSettings.currentRenderPipeline = new RenderPipelineAsset {
      defaultMaterial = new Material(Shader.Find("another pipeline's")),
    };
    SceneView.lastActiveSceneView = new SceneView();
    CreateTwin.Apply();
    Require(SceneView.lastActiveSceneView.Framed == Selection.activeGameObject, "the twin in the middle of the view");
    Require(Selection.activeGameObject.transform.position.y == CreateTwin.Height, "the twin above the floor");
    var root = Selection.activeGameObject;
    Require(root.name == "Trunkline twin" && Undo.Registered.Contains(root), "the menu entry's object");
    Require(root.GetComponent<Twin>().ManifestFile.name == "manifest", "Twin's manifest");
    var arm = root.GetComponentsInChildren<SoftReach>();
    bool sheets = Asset("Reachability/sheets.bytes") != null;
    Require(arm.Length == (sheets ? 1 : 0) && arm.All(one => one.name == "base"), "Soft Reach on the body `base`");
    var renderers = root.GetComponentsInChildren<Renderer>();
    Require(renderers.Length > 1 && renderers.All(one => one.sharedMaterial.shader.name == "another pipeline's"
        && one.sharedMaterial.color.r == 0.93f), "materials of the project's pipeline, in the model's colours");
    Require(Time.fixedDeltaTime == step && Physics.gravity.Equals(gravity), "project settings as they were");
    Console.WriteLine($"menu {renderers.Length} materials");

    string folder = PackageInfo.Folder;
    PackageInfo.Folder = Path.Combine(folder, "nowhere");
    Require(CreateTwin.InScene() == null, "no twin without a model");
    Require(Last().StartsWith($"error: Trunkline: {folder}/nowhere/Runtime/Model/arm.xml: found that MuJoCo does not"),
            "one line about a model that is not imported");
    PackageInfo.Folder = folder;
    PackageInfo.Copied = true;
    Require(CreateTwin.InScene() == null && Last().StartsWith("error: Trunkline: found these scripts in no package"),
            "one line about scripts that were copied");
    PackageInfo.Copied = false;
  }

  private static void Sample() {
    int made = Undo.Registered.Count;
    EditorSceneManager.Cancelled = true;
    BuildScene.Apply();
    Require(EditorSceneManager.Called.SequenceEqual(new[] { "save" }) && Undo.Registered.Count == made,
            "the open scene as it was, where the user cancels");
    EditorSceneManager.Cancelled = false;
    EditorSceneManager.Called.Clear();
    BuildScene.Apply();
    Require(EditorSceneManager.Called.SequenceEqual(new[] { "save", $"Single scene beside {made} objects" })
        && Undo.Registered.Count == made + 1, "a scene of its own before anything is made");
    var twin = Selection.activeGameObject;
    var bending = twin.GetComponent<BendingTwin>();
    Require(bending.Pointing.MapFiles.All(file => file != null), "the sample's maps");
    Awake(bending.Pointing);
    var shown = bending.Pointing.GetComponent<ShownTargets>();
    Call(shown, "OnEnable");
    Call(bending, "OnEnable");
    Require(bending.Base.name == "base" && bending.Mount.position.y == CreateTwin.Height
        && twin.transform.parent == bending.Mount, "a twin below its mount");
    Awake(bending);
    Require(shown.LeftRay.sharedMaterial != null, "a ray's material");
    var hands = bending.Pointing.GetComponent<TrackedHands>();
    var floor = new XRInputSubsystem();
    SubsystemManager.Running.AddRange(new ISubsystem[] { floor, new XRDisplaySubsystem { Rate = 90 } });
    Call(hands, "Update");
    Require(hands.Twin.DisplayRate == 90 && floor.GetTrackingOriginMode() == TrackingOriginModeFlags.Floor,
            "the headset's rate and floor");
    SubsystemManager.Running.Clear();
    Call(bending.Pointing, "Update");
    Require(bending.Pointing.Intent.Mode == Mode.Hold && !shown.Tip.enabled && !shown.LeftRay.enabled,
            "a sample without controllers holds");
    Console.WriteLine($"sample {bending.Pointing.MapFiles.Length} maps");
  }

  // --- components beside Python

  private static void Reach() {
    var cases = List(_cases["reach"]);
    if (cases.Count > 0) {
      var arm = new GameObject("base");
      var reach = arm.AddComponent<SoftReach>();
      reach.ManifestFile = Asset("manifest.json");
      reach.PointsFile = Asset("Reachability/sheets.bytes");
      reach.WeightsFile = Asset("Reachability/sheet_weights.bytes");
      Awake(reach);
      try {
        reach.Signal(new Vector3(float.NaN, 0, 0), out _);
        Require(false, "a position that is not a number");
      } catch (InputError error) {
        Compare("reach of NaN", Block(_cases["refusals"])["no number"], error.Message);
      }
      foreach (object one in cases) {
        Dictionary<string, object> asked = Block(Block(one)["question"]), answer = Block(Block(one)["answer"]);
        arm.transform.rotation = UnityFrames.ToUnity(Quaternion(asked["base"]));
        Physics.gravity = UnityFrames.ToUnity(Vector(asked["gravity"]));
        Call(reach, "Update");
        float signal = reach.Signal(UnityFrames.ToUnity(Vector(asked["tip"])), out var nearest);
        Compare("reach", answer, new Dictionary<string, object> {
          ["signal"] = (double)signal, ["nearest"] = Json(UnityFrames.ToCore(nearest)),
          ["first"] = Json(UnityFrames.ToCore(reach.Points[0])),
          ["down"] = Json(UnityFrames.ToCore(SoftReach.DownOf(arm.transform))),
        });
      }
    }
    Console.WriteLine($"reach {cases.Count} cases");
  }

  private static void Steps() {
    int count = 0;
    foreach (object sequence in List(_cases["sequences"])) {
      var pointing = new GameObject("Pointing").AddComponent<Pointing>();
      pointing.ManifestFile = Asset("manifest.json");
      pointing.SettingsFile = Asset("teleoperation.json");
      pointing.MapFiles = CreateTwin.Maps(PackageInfo.FindForAssembly(null));
      pointing.LeftHand = new GameObject("left").transform;
      pointing.RightHand = new GameObject("right").transform;
      pointing.RobotBase = new GameObject("base").transform;
      Awake(pointing);
      var bending = Bending(pointing);
      var modes = new List<Mode>();
      var asked = new List<int>();
      pointing.ModeChanged += modes.Add;
      pointing.PlanAsked += request => asked.Add(request.Serial);
      var expectedModes = new List<Mode>();
      var expectedSerials = new List<int>();
      var before = Mode.Hold;
      foreach (object one in List(Block(sequence)["steps"])) {
        var step = Block(one);
        Give(pointing, Input(step["input"]));
        Time.unscaledTime += 1;
        pointing.Step(Number(Block(step["input"])["stamp"]), Number(step["dt"]));
        Follows(bending, pointing);
        new Comparison().Of($"steps: {Block(sequence)["name"]}[{count++}]", step["intent"], Json(pointing.Intent));
        if (pointing.Intent.Mode != before) {
          expectedModes.Add(before = pointing.Intent.Mode);
        }
        int? serial = pointing.Intent.Request?.Serial;
        if (serial != null && !expectedSerials.Contains(serial.Value)) {
          expectedSerials.Add(serial.Value);
        }
        if (pointing.Intent.Targets != null && pointing.Alignment != null) {
          var tip = pointing.Intent.Targets.Tip.Position;
          var there = pointing.RobotBase.TransformPoint(UnityFrames.ToUnity(tip));
          Compare("a target in the scene", Json(UnityFrames.ToCore(there)),
                  Json(UnityFrames.ToCore(pointing.InScene(tip).Value)));
          Offered(pointing, pointing.Intent.Targets.Tip.Offer, pointing.TipOffer);
          Offered(pointing, pointing.Intent.Targets.Rigid.Offer, pointing.RigidOffer);
        }
      }
      Require(modes.SequenceEqual(expectedModes) && asked.SequenceEqual(expectedSerials), "events of the steps");
    }
    Console.WriteLine($"steps {count} cases");
    Console.WriteLine($"offers {_offers} cases");
    Console.WriteLine($"mounts {_mounts} cases");
    Console.WriteLine($"asked {_asked} times");
  }

  // The sample's twin, whose network foresees the tip wherever it is asked for.
  private static BendingTwin Bending(Pointing pointing) {
    var twin = new GameObject("twin");
    var bending = twin.AddComponent<BendingTwin>();
    bending.Pointing = pointing;
    bending.Twin = twin.AddComponent<Twin>();
    bending.Network = twin.AddComponent<ArmNetwork>();
    bending.Network.ManifestFile = Asset("manifest.json");
    bending.Network.NetworkFile = Model((int)Number(_cases["inputs"]), (poses, count) => {
      _asked++;
      int width = poses.Length / count;
      return new Dictionary<string, float[]> {
        ["commands"] = new float[3 * count], ["lengths"] = new float[3 * count],
        ["tip"] = Enumerable.Range(0, 3 * count).Select(i => poses[i / 3 * width + width - 7 + i % 3]).ToArray(),
      };
    });
    Awake(bending.Network);
    bending.Mount = new GameObject("mount").transform;
    bending.Base = new GameObject("base").transform;
    bending.Base.parent = bending.Mount;
    bending.Base.localPosition = new Vector3(0.01f, 0.02f, 0.03f);
    bending.Base.localRotation = new UnityEngine.Quaternion(0.6f, 0, 0, 0.8f);
    Awake(bending);
    Call(bending, "OnEnable");
    return bending;
  }

  // Its base is where the robot will have it, under gravity as the network was told; and it asks for nothing twice.
  private static void Follows(BendingTwin bending, Pointing pointing) {
    var targets = pointing.Intent.Targets;
    bool inside = targets != null && targets.Rigid.Reach == Where.Inside && targets.Tip.Reach == Where.Inside;
    if (!inside) {
      return;
    }
    var turn = Alignment.BaseQuaternion(targets.Pointing, targets.Heading);
    if (bending.Network.TryBend(Vector3.forward, UnityFrames.ToUnity(Rotated(turn)), 1, out _)) {
      _mounts++;
      var there = pointing.InScene(targets.Rigid.Position).Value;
      Near(there, bending.Base.position, 2e-3, "the base at the rigid target");
      Near(UnityFrames.ToUnity(Trunkline.Vectors.Rotate(Trunkline.Vectors.Conjugate(turn), Trunkline.Vectors.Down)),
           bending.Base.InverseTransformDirection(RobotDown(pointing)), 0.02, "gravity on the twin");
    }
    int before = _asked;
    Time.unscaledTime += 1;
    typeof(BendingTwin).GetMethod("Follow", BindingFlags.Instance | BindingFlags.NonPublic)
        .Invoke(bending, new object[] { pointing.Intent });
    Require(_asked == before, "targets that stand still ask for nothing");
  }

  private static Vector Rotated(Quaternion turn) =>
      Trunkline.Vectors.Rotate(Trunkline.Vectors.Conjugate(turn), Trunkline.Vectors.Down);

  // Down in the robot's base, in the scene: recorded bases need not stand upright.
  private static Vector3 RobotDown(Pointing pointing) =>
      pointing.RobotBase.rotation * UnityFrames.ToUnity(Trunkline.Vectors.Down);

  private static void Near(Vector3 expected, Vector3 found, double within, string what) => Require(
      Trunkline.Vectors.Distance(UnityFrames.ToCore(expected), UnityFrames.ToCore(found)) < within, what);

  private static void Offered(Pointing pointing, Vector? offer, Vector3? found) {
    Require(offer == null == (found == null), "an offer where there is one");
    if (offer != null) {
      _offers++;
      var there = pointing.RobotBase.TransformPoint(UnityFrames.ToUnity(offer.Value));
      Compare("an offer in the scene", Json(UnityFrames.ToCore(there)), Json(UnityFrames.ToCore(found.Value)));
    }
  }

  // Three places, or six, that a controller touches on a robot that stands somewhere.
  private static void Touches() {
    var cases = List(_cases["touches"]);
    foreach (object one in cases) {
      var asked = Block(Block(one)["question"]);
      var pointing = new GameObject("Pointing").AddComponent<Pointing>();
      pointing.RobotBase = new GameObject("base").transform;
      var known = Messages.Vectors(asked["known"]);
      pointing.AlignBase(Messages.Vectors(asked["touched"]).ConvertAll(UnityFrames.ToUnity), known);
      Compare("touches", Block(one)["answer"], new Dictionary<string, object> {
        ["position"] = Json(UnityFrames.ToCore(pointing.RobotBase.position)),
        ["ahead"] = Json(UnityFrames.ToCore(pointing.RobotBase.forward)),
      });
    }
    Console.WriteLine($"touches {cases.Count} cases");
  }

  // A recorded input as a scene has it: transforms in Unity's axes, of 32 bits.
  private static void Give(Pointing pointing, Input given) {
    var there = Aligning.Inverse(given.Alignment);
    pointing.RobotBase.SetPositionAndRotation(UnityFrames.ToUnity(there.Position),
                                              UnityFrames.ToUnity(there.Quaternion));
    pointing.Left = Place(pointing.LeftHand, given.Left);
    pointing.Right = Place(pointing.RightHand, given.Right);
    pointing.Joints = given.Joints.ToArray();
    pointing.World = given.World;
    pointing.Plan = given.Plan;
    pointing.Shown = given.Shown;
    pointing.Executor = given.Executor;
    pointing.Offer = given.Offer;
  }

  private static HandInput Place(Transform hand, Controller given) {
    // The core's ray is along -z and y is up; a hand's in Unity is forward, and its up is up.
    var turn = Trunkline.Vectors.Multiply(
        given.Quaternion, Trunkline.Vectors.About(new Vector(1, 0, 0), -Math.PI / 2));
    hand.SetPositionAndRotation(UnityFrames.ToUnity(given.Position), UnityFrames.ToUnity(turn));
    var ahead = Trunkline.Vectors.Rotate(given.Quaternion, new Vector(0, 0, -1));
    if (given.Tracked && !double.IsNaN(given.Position.X)) {
      Compare("a hand's forward", Json(ahead), Json(UnityFrames.ToCore(hand.forward)));
    }
    return new HandInput {
      Tracked = given.Tracked, Trigger = given.Trigger, Grip = given.Grip, StickPressed = given.StickPressed,
      Primary = given.Primary, Secondary = given.Secondary,
      Stick = new Vector2((float)given.StickX, (float)given.StickY),
    };
  }

  private static void Network() {
    var cases = List(_cases["bend"]);
    foreach (object one in cases) {
      Dictionary<string, object> asked = Block(Block(one)["question"]), told = Block(asked["network"]);
      var network = new GameObject("arm").AddComponent<ArmNetwork>();
      network.ManifestFile = Asset("manifest.json");
      network.NetworkFile = Model((int)Number(_cases["inputs"]), (poses, count) => told.ToDictionary(
          entry => entry.Key,
          entry => Numbers(entry.Value).Take(List(entry.Value).Count / List(asked["poses"]).Count * count)
              .Select(number => (float)number).ToArray()));
      Awake(network);
      var found = network.Bend(UnityFrames.ToUnity(Vector(asked["tip"])), UnityFrames.ToUnity(Vector(asked["gravity"])),
                               (float)Number(asked["tolerance"]));
      var answer = Json(found);
      answer.Remove("doubtful");
      answer.Remove("unsure");
      answer["pulls"] = Json(network.Kinematics.PullsOf(found));
      Compare("bend", Block(one)["answer"], answer);
    }
    Console.WriteLine($"bend {cases.Count} cases");
  }

  private static ModelAsset Model(int width, Func<float[], int, Dictionary<string, float[]>> answer) => new ModelAsset {
    name = "ik", Width = width, Outputs = new[] { "commands", "lengths", "tip" }, Answer = answer,
  };

  // --- what is bad: one line in the console, and the component is off

  private static void Refusals() {
    var expected = Block(_cases["refusals"]);
    var reach = new GameObject("base").AddComponent<SoftReach>();
    Refused("Soft Reach", reach, expected["no file"]);
    reach.ManifestFile = Asset("manifest.json");
    reach.PointsFile = new TextAsset("another") { name = "rigid" };
    reach.WeightsFile = reach.PointsFile;
    Refused("Soft Reach", reach, expected["another file"]);
    reach.PointsFile = new TextAsset("another") { name = "foreign" };
    Refused("Soft Reach", reach, expected["foreign file"]);

    var network = new GameObject("arm").AddComponent<ArmNetwork>();
    network.ManifestFile = Asset("manifest.json");
    Refused("Arm Network", network, expected["no network"]);
    network.NetworkFile = Model(7, (poses, count) => new Dictionary<string, float[]> {
      ["commands"] = new float[3], ["lengths"] = new float[3], ["tip"] = new float[3],
    });
    Refused("Arm Network", network, expected["other network"]);

    var pointing = new GameObject("Pointing").AddComponent<Pointing>();
    pointing.ManifestFile = Asset("manifest.json");
    Refused("Pointing", pointing, expected["no settings"]);
    pointing.SettingsFile = Asset("teleoperation.json");
    Refused("Pointing", pointing, expected["no maps"]);
    Console.WriteLine("refusals 7 cases");
    Require(_unready == 7, "what is not ready refuses");

    network.NetworkFile = Model((int)Number(_cases["inputs"]),
                                (poses, count) => { throw new NotSupportedException("no op\nat"); });
    Refused("Arm Network", network, "ik: found that the inference engine does not run it (no op), expected "
        + "Runtime/Network/ik.onnx");
  }

  private static void Refused(string name, MonoBehaviour component, object expected) {
    component.enabled = true;
    Awake(component);
    Compare(name, $"error: {name}: {expected}", Last());
    Require(!component.enabled, $"{name} is off");
    NotReady(() => (component as SoftReach)?.Signal(Vector3.forward, out _), name);
    NotReady(() => (component as ArmNetwork)?.Bend(Vector3.forward, Vector3.forward, 1), name);
    NotReady(() => (component as Pointing)?.Step(0, 0), name);
  }

  private static void NotReady(Action asked, string name) {
    try {
      asked();
    } catch (InputError error) {
      _unready++;
      Require(error.Message.StartsWith($"{name}: found one that is not ready"), "one line about what is not ready");
    }
  }

  // As Unity's test runner does.
  private static void ForTheTestRunner() {
    var tests = new SharedVectorsTests();
    tests.ReadPackage();
    int count = 0;
    foreach (var method in typeof(SharedVectorsTests).GetMethods()) {
      foreach (var one in method.GetCustomAttributes<TestCaseAttribute>()) {
        method.Invoke(tests, one.Arguments);
        count++;
      }
    }
    string written = Path.Combine(PackageInfo.Folder, "package.json");
    string before = File.ReadAllText(written);
    File.WriteAllText(written, "{\"_fingerprint\": 0," + before.Substring(1));  // as Unity 6 does
    tests.ReadPackage();
    File.WriteAllText(written, before);
    Console.WriteLine($"runner {count} cases");
  }

  private static string Last() => Debug.Told[Debug.Told.Count - 1];
}
}
