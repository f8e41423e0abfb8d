using System.Collections.Generic;
using System.IO;
using NUnit.Framework;
using UnityEditor.PackageManager;

namespace Trunkline.Tests {

/// <summary>For Unity's test runner: the core answers the shared vectors as Python does. Name the package under
/// `testables` in the project's Packages/manifest.json.</summary>
public class SharedVectorsTests {
  private SharedVectors _shared;

  [OneTimeSetUp]
  public void ReadPackage() {
    string root = PackageInfo.FindForAssembly(typeof(SharedVectorsTests).Assembly).resolvedPath;
    var files = new Dictionary<string, byte[]>();
    foreach (string folder in new[] { "Runtime", "Tests" }) {  // Unity writes into package.json as it unpacks it
      foreach (string path in Directory.GetFiles(Path.Combine(root, folder), "*", SearchOption.AllDirectories)) {
        files[path.Substring(root.Length + 1).Replace('\\', '/')] = File.ReadAllBytes(path);
      }
    }
    Unpacked.PartDigest(files, Unpacked.ManifestOf(files));
    _shared = new SharedVectors(files);
  }

  [TestCase("alignment")]
  [TestCase("rigid_reach")]
  [TestCase("soft_reach")]
  [TestCase("targets")]
  [TestCase("network")]
  [TestCase("steps")]
  public void AnswersAsPython(string name) => Assert.DoesNotThrow(() => _shared.Test(name));
}
}
