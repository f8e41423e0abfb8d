using System.Collections.Generic;
#if MUJOCO_HAS_POLYNOMIAL_SPRINGS
using System;
using System.IO;
using System.Linq;
using Mujoco;
#endif
using UnityEditor;
using UnityEngine;
using UnityEngine.Rendering;
using PackageInfo = UnityEditor.PackageManager.PackageInfo;

namespace Trunkline {

/// <summary>The menu entry that puts the calibrated arm into the open scene, ready to play. It changes no project
/// setting.</summary>
public static class CreateTwin {
  /// <summary>m, at which the arm's root stands: the arm hangs below it.</summary>
  public const float Height = 1.2f;

  private const string _undo = "Create twin in scene";

  /// <summary>The menu entry: the twin in the open scene, in the middle of the view.</summary>
  [MenuItem("Trunkline/Create twin in scene")]
  public static void Apply() {
    if (InScene() != null && SceneView.lastActiveSceneView != null) {
      SceneView.lastActiveSceneView.FrameSelected();
    }
  }

  /// <summary>The imported model's root with its components; null, and one line in the console, where it cannot be
  /// made.</summary>
  public static GameObject InScene() {
#if MUJOCO_HAS_POLYNOMIAL_SPRINGS
    var package = PackageInfo.FindForAssembly(typeof(CreateTwin).Assembly);
    if (package == null) {  // as where the scripts were copied into Assets
      Debug.LogError("Trunkline: found these scripts in no package, expected org.trunkline.twin as the package manager "
          + "installs it");
      return null;
    }
    var root = Import(Path.Combine(package.resolvedPath, "Runtime", "Model", "arm.xml"));
    if (root == null) {
      return null;
    }
    root.name = "Trunkline twin";
    root.transform.position = new Vector3(0, Height, 0);
    PlaceMaterials(root);
    root.AddComponent<Twin>().ManifestFile = Asset(package, "manifest.json");
    var points = Asset(package, "Reachability/sheets.bytes");
    if (points != null) {  // none in a package for gravity of one tilt
      var arm = root.GetComponentsInChildren<MjBody>().First(body => body.name == "base");
      var reach = arm.gameObject.AddComponent<SoftReach>();
      reach.ManifestFile = Asset(package, "manifest.json");
      reach.PointsFile = points;
      reach.WeightsFile = Asset(package, "Reachability/sheet_weights.bytes");
    }
    Undo.RegisterCreatedObjectUndo(root, _undo);
    Selection.activeGameObject = root;
    return root;
#else
    Debug.LogError("Trunkline: found no org.mujoco of 3.7.0 or later in the project, expected MuJoCo's own package");
    return null;
#endif
  }

  /// <summary>A text file of the package's Runtime folder, as Unity imports it; null where there is none.</summary>
  public static TextAsset Asset(PackageInfo package, string path) =>
      AssetDatabase.LoadAssetAtPath<TextAsset>($"{package.assetPath}/Runtime/{path}");

  /// <summary>The maps that Pointing takes: the mount's, and the tip's under gravity from any side or of one
  /// tilt.</summary>
  public static TextAsset[] Maps(PackageInfo package) {
    PackageFiles.Of(Asset(package, "manifest.json"), out var manifest, out _);
    var reach = manifest.Block("reach");
    var names = new List<string> { "rigid" };
    names.AddRange(reach.Has("sheets") ? new[] { "sheets", "sheet_weights" } : reach.Texts("grids"));
    return names.ConvertAll(name => Asset(package, $"Reachability/{name}.bytes")).ToArray();
  }

#if MUJOCO_HAS_POLYNOMIAL_SPRINGS
  // The importer tells what is wrong in the console, and either throws or gives nothing.
  private static GameObject Import(string path) {
    string why = "its importer says why";
    try {
      var root = new MjImporterWithAssets().ImportFile(path);
      if (root != null) {
        return root;
      }
    } catch (Exception error) {
      why = error.Message.Split('\n')[0];
    }
    Debug.LogError($"Trunkline: {path}: found that MuJoCo does not import it ({why}), expected org.mujoco with its "
        + "native library, of the version that manifest.json names");
    return null;
  }
#endif

  /// <summary>Gives each material the shader of the project's render pipeline: the importer's own is the built-in
  /// pipeline's, and pink elsewhere.</summary>
  public static void PlaceMaterials(GameObject root) {
    var pipeline = GraphicsSettings.currentRenderPipeline;
    if (pipeline == null) {
      return;
    }
    foreach (var renderer in root.GetComponentsInChildren<Renderer>()) {
      var material = renderer.sharedMaterial;
      var color = material.color;
      material.shader = pipeline.defaultMaterial.shader;
      material.color = color;
      EditorUtility.SetDirty(material);
    }
  }
}
}
