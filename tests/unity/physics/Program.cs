// Runs Twin.cs in a scene that simulates:
//
//   mono physics.exe SCENE
//
// SCENE says where libmujoco's fields are, which models there are and what is in them, what the manifest is, and what
// happens. It prints a line where it is asked: all angles, all activations, and what the console was told since.

using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Reflection;
using Mujoco;
using UnityEngine;

namespace Trunkline.Tests {
using static Messages;

internal static unsafe class Program {
  private static Dictionary<string, object> _scene;
  private static readonly List<MjComponent> _components = new List<MjComponent>();
  private static readonly Dictionary<string, GameObject> _roots = new Dictionary<string, GameObject>();

  public static int Main(string[] given) {
    CultureInfo.CurrentCulture = CultureInfo.GetCultureInfo("de-DE");  // whose decimals have a comma
    _scene = Block(Json.Read(File.ReadAllBytes(given[0]), given[0]));
    JsonUtility.Read = ReadAs.Text;
    MujocoLib.ModelFields = Places("model_fields");
    MujocoLib.DataFields = Places("data_fields");
    MujocoLib.mjVERSION_HEADER = _scene.TryGetValue("header", out object header) ? (int)Number(header)
        : MujocoLib.mj_version();
    MjScene.Instance.Components = () => _components;
    MjScene.Instance.Bind = Bind;
    foreach (object one in List(_scene["happens"])) {
      Happen(List(one));
    }
    return 0;
  }

  private static Dictionary<string, int> Places(string key) =>
      Block(_scene[key]).ToDictionary(one => one.Key, one => (int)Number(one.Value));

  private static void Happen(List<object> what) {
    var scene = MjScene.Instance;
    switch ((string)what[0]) {
      case "arm":
        Add((string)what[1], (string)what[2]);
        break;
      case "write":
        scene.WriteScene();
        break;
      case "compile":
        scene.CreateScene((string)what[1]);
        break;
      case "recreate":
        scene.RecreateScene((string)what[1]);
        break;
      case "control":
        _components.OfType<MjActuator>().Single(one => Full(one) == (string)what[1]).Control = (float)Number(what[2]);
        break;
      case "send":
        _roots[(string)what[1]].GetComponent<Twin>().Send(Numbers(what[2]));
        break;
      case "step":
        for (int i = 0; i < Number(what[1]); i++) {
          scene.FixedUpdate();
        }
        break;
      case "camera":
        Camera.main = new GameObject("camera").AddComponent<Camera>();
        break;
      case "frames":
        for (int i = 0; i < Number(what[1]); i++) {
          Frame(scene, Number(what[2]), Number(what[3]));
        }
        break;
      case "disable":
        Call(_roots[(string)what[1]].GetComponent<Twin>(), "OnDisable");
        break;
      case "look":
        Look();
        break;
      case "tell":
        Tell(scene);
        break;
    }
  }

  // One of the display, which took so many seconds of real time and as many steps.
  private static void Frame(MjScene scene, double real, double steps) {
    for (int i = 0; i < steps; i++) {
      scene.FixedUpdate();
    }
    Time.unscaledDeltaTime = (float)real;
    foreach (var root in _roots.Values) {
      Call(root.GetComponent<Twin>(), "Update");
    }
  }

  // What stands before the camera, among what the console was told.
  private static void Look() {
    var texts = Camera.main.GetComponentsInChildren<TextMesh>();
    Debug.Told.Add("shown: " + string.Join(" and ", texts.Select(
        one => $"{one.text.Replace("\n", " / ")} at {one.transform.localPosition.z} m")));
  }

  private static void Call(Twin twin, string name) =>
      typeof(Twin).GetMethod(name, BindingFlags.Instance | BindingFlags.NonPublic).Invoke(twin, null);

  // An arm's root with objects for all that a model has of it, and the component.
  private static void Add(string prefix, string model) {
    var root = _roots[prefix] = new GameObject(prefix);
    foreach (var one in Block(Block(_scene["models"])[model])) {
      if (one.Key.StartsWith(prefix)) {
        var child = new GameObject(one.Key.Substring(prefix.Length));
        child.transform.parent = root.transform;
        string kind = (string)List(one.Value)[0];
        _components.Add(kind == "joint" ? child.AddComponent<MjHingeJoint>()
            : kind == "tendon" ? child.AddComponent<MjFixedTendon>() : (MjComponent)child.AddComponent<MjActuator>());
      }
    }
    var twin = root.AddComponent<Twin>();
    twin.DisplayRate = (float)Number(_scene["display_rate"]);
    twin.ManifestFile = new TextAsset(File.ReadAllBytes((string)_scene["manifest"]));
    Call(twin, "OnEnable");
  }

  private static string Full(MjComponent component) => component.transform.parent.name + component.name;

  private static void Bind(string model) {
    var numbers = Block(Block(_scene["models"])[model]);
    foreach (var component in _components) {
      component.MujocoId = (int)Number(List(numbers[Full(component)])[1]);
      if (component is MjHingeJoint joint) {  // all joints are hinges, with the same places everywhere
        joint.QposAddress = joint.DofAddress = joint.MujocoId;
      }
    }
    MujocoLib.Nq = MujocoLib.Nv = numbers.Values.Count(one => (string)List(one)[0] == "joint");
  }

  private static void Tell(MjScene scene) {
    var told = CultureInfo.CurrentCulture;
    CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
    var angles = Enumerable.Range(0, MujocoLib.Nq).Select(i => scene.Data->qpos[i].ToString("R"));
    int actuators = _components.OfType<MjActuator>().Count();
    var activations = Enumerable.Range(0, actuators).Select(i => scene.Data->act[i].ToString("R"));
    Console.WriteLine(string.Join(" ", angles) + ";" + string.Join(" ", activations) + ";"
        + $"{Time.fixedDeltaTime:R} {Time.maximumDeltaTime:R};" + string.Join("|", Debug.Told));
    Debug.Told.Clear();
    CultureInfo.CurrentCulture = told;
  }
}
}
