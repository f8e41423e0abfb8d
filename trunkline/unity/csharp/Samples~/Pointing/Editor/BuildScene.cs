using System.Linq;
using Mujoco;
using Unity.InferenceEngine;
using UnityEditor;
using UnityEditor.SceneManagement;
using UnityEngine;
using PackageInfo = UnityEditor.PackageManager.PackageInfo;

namespace Trunkline.Samples {

/// <summary>Builds the sample's scene: the twin on a mount that moves, a robot's base, two hands, what shows the
/// targets.</summary>
public static class BuildScene {
  private const float _ahead = 1;  // m from the origin, where the user stands
  private const float _target = 0.03f, _offer = 0.015f, _ray = 0.003f;  // m across

  [MenuItem("Trunkline/Build sample scene: Pointing")]
  public static void Apply() {
    if (!EditorSceneManager.SaveCurrentModifiedScenesIfUserWantsTo()) {
      return;
    }
    EditorSceneManager.NewScene(NewSceneSetup.DefaultGameObjects, NewSceneMode.Single);
    var twin = CreateTwin.InScene();
    if (twin == null) {
      return;
    }
    var mount = new GameObject("Mount").AddComponent<MjMocapBody>().transform;
    mount.position = new Vector3(0.5f, CreateTwin.Height, _ahead);
    twin.transform.SetParent(mount, false);
    twin.transform.localPosition = Vector3.zero;
    var robot = new GameObject("Robot base").transform;
    robot.position = new Vector3(0, 0, _ahead);

    var package = PackageInfo.FindForAssembly(typeof(CreateTwin).Assembly);
    var pointing = new GameObject("Pointing").AddComponent<Pointing>();
    pointing.ManifestFile = CreateTwin.Asset(package, "manifest.json");
    pointing.SettingsFile = CreateTwin.Asset(package, "teleoperation.json");
    pointing.MapFiles = CreateTwin.Maps(package);
    pointing.LeftHand = new GameObject("Left hand").transform;
    pointing.RightHand = new GameObject("Right hand").transform;
    pointing.RobotBase = robot;
    var hands = pointing.gameObject.AddComponent<TrackedHands>();
    hands.Pointing = pointing;
    hands.Twin = twin.GetComponent<Twin>();
    if (Camera.main != null) {
      hands.Head = Camera.main.transform;
    }

    var shown = pointing.gameObject.AddComponent<ShownTargets>();
    shown.Pointing = pointing;
    shown.LeftRay = Ray(pointing.LeftHand);
    shown.RightRay = Ray(pointing.RightHand);
    shown.Rigid = Ball("Rigid target", _target);
    shown.Tip = Ball("Tip target", _target);
    shown.RigidOffer = Ball("Rigid offer", _offer);
    shown.TipOffer = Ball("Tip offer", _offer);

    var network = twin.AddComponent<ArmNetwork>();
    network.ManifestFile = pointing.ManifestFile;
    network.NetworkFile = AssetDatabase.LoadAssetAtPath<ModelAsset>($"{package.assetPath}/Runtime/Network/ik.onnx");
    var bending = twin.AddComponent<BendingTwin>();
    bending.Pointing = pointing;
    bending.Network = network;
    bending.Twin = twin.GetComponent<Twin>();
    bending.Mount = mount;
    bending.Base = twin.GetComponentsInChildren<MjBody>().First(body => body.name == "base").transform;
  }

  private static LineRenderer Ray(Transform hand) {
    var line = hand.gameObject.AddComponent<LineRenderer>();
    line.useWorldSpace = true;
    line.positionCount = 2;
    line.widthMultiplier = _ray;
    line.sharedMaterial = AssetDatabase.GetBuiltinExtraResource<Material>("Default-Line.mat");
    return line;
  }

  private static Renderer Ball(string name, float size) {
    var ball = GameObject.CreatePrimitive(PrimitiveType.Sphere);
    ball.name = name;
    ball.transform.localScale = size * Vector3.one;
    return ball.GetComponent<Renderer>();
  }
}
}
