// A stub of Unity's editor: the signatures that the Unity package's C# uses, after Unity 6's scripting reference.
// Assets are the files of a folder that a test names; what is registered or selected is kept, for a test to look at.

using System;
using System.Collections.Generic;
using System.IO;
using System.Reflection;
using UnityEngine;
using UnityEngine.SceneManagement;

namespace UnityEditor {

[AttributeUsage(AttributeTargets.Method)]
public class MenuItem : Attribute {
  public readonly string menuItem;

  public MenuItem(string itemName) {
    menuItem = itemName;
  }
}

public static class AssetDatabase {
  public static T GetBuiltinExtraResource<T>(string path) where T : UnityEngine.Object =>
      (T)(UnityEngine.Object)new Material(Shader.Find("Standard")) { name = path };

  public static T LoadAssetAtPath<T>(string assetPath) where T : UnityEngine.Object {
    string path = assetPath.Replace(PackageManager.PackageInfo.Only.assetPath, PackageManager.PackageInfo.Folder);
    if (!File.Exists(path)) {
      return null;
    }
    UnityEngine.Object found = new TextAsset(File.ReadAllBytes(path));
    if (typeof(T) != typeof(TextAsset)) {
      found = Activator.CreateInstance<T>();
    }
    found.name = Path.GetFileNameWithoutExtension(path);
    return (T)found;
  }
}

public class SceneView {
  /// <summary>Not of Unity's: what it looks at.</summary>
  public GameObject Framed;

  public static SceneView lastActiveSceneView { get; set; }

  public bool FrameSelected() {
    Framed = Selection.activeGameObject;
    return Framed != null;
  }
}

public static class EditorUtility {
  public static void SetDirty(UnityEngine.Object target) {}
}

public static class Undo {
  public static readonly List<UnityEngine.Object> Registered = new List<UnityEngine.Object>();

  public static void RegisterCreatedObjectUndo(UnityEngine.Object objectToUndo, string name) =>
      Registered.Add(objectToUndo);
}

public static class Selection {
  public static GameObject activeGameObject { get; set; }
}
}

namespace UnityEditor.PackageManager {

public class PackageInfo {
  /// <summary>Not of Unity's: the folder of the only package that there is.</summary>
  public static string Folder;
  internal static readonly PackageInfo Only = new PackageInfo();

  /// <summary>Not of Unity's: whether assemblies are of no package.</summary>
  public static bool Copied;

  public string name => "org.trunkline.twin";
  public string assetPath => "Packages/org.trunkline.twin";
  public string resolvedPath => Folder;

  public static PackageInfo FindForAssembly(Assembly assembly) => Copied ? null : Only;
}
}

namespace UnityEditor.SceneManagement {

public enum NewSceneSetup { EmptyScene, DefaultGameObjects }

public enum NewSceneMode { Single, Additive }

public static class EditorSceneManager {
  /// <summary>Not of Unity's: whether the user cancels, and what was called, one after the other.</summary>
  public static bool Cancelled;
  public static readonly List<string> Called = new List<string>();

  public static bool SaveCurrentModifiedScenesIfUserWantsTo() {
    Called.Add("save");
    return !Cancelled;
  }

  public static Scene NewScene(NewSceneSetup setup, NewSceneMode mode) {
    Called.Add($"{mode} scene beside {Undo.Registered.Count} objects");
    return new Scene();
  }
}
}
