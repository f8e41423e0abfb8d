// A stub of the editor's part of MuJoCo's package for Unity (org.mujoco), written as Mujoco.cs is. Its importer reads
// the names of bodies and geoms of an MJCF file, which is what a menu entry looks for.

using System;
using System.IO;
using System.Xml;
using UnityEngine;

namespace Mujoco {

public class MjcfImporter {}

public class MjImporterWithAssets : MjcfImporter {
  public unsafe GameObject ImportFile(string filePath) {
    if (!File.Exists(filePath)) {
      throw new IOException($"{filePath}: no such file");
    }
    var mjcf = new XmlDocument();
    mjcf.Load(filePath);
    var root = new GameObject(Path.GetFileNameWithoutExtension(filePath) + "123");
    Add(root, (XmlElement)mjcf.SelectSingleNode("/mujoco/worldbody"));
    return root;
  }

  private static void Add(GameObject parent, XmlElement element) {
    foreach (XmlNode node in element.ChildNodes) {
      if (node.Name == "body" || node.Name == "geom") {
        var child = new GameObject(((XmlElement)node).GetAttribute("name"));
        child.transform.parent = parent.transform;
        if (node.Name == "body") {
          child.AddComponent<MjBody>();
          Add(child, (XmlElement)node);
        } else {
          child.AddComponent<MeshRenderer>().sharedMaterial =
              new Material(Shader.Find("Standard")) { color = new Color(0.93f, 0.55f, 0.2f, 1) };
        }
      }
    }
  }
}
}
