using System;
using System.Collections.Generic;
using UnityEngine;

namespace Trunkline {

/// <summary>Files of the package by their paths in it, as the core takes them, from text assets: as such Unity imports
/// `.json` and `.bytes`. Nothing is read from StreamingAssets.</summary>
public static class PackageFiles {
  public const string Manifest = "Runtime/manifest.json";

  /// <summary>The manifest and `others`; each is known by its name and lies where the manifest says.</summary>
  /// <exception cref="InputError">One is missing in the component's fields, is none of the package's, or is of another
  /// version of it.</exception>
  public static Dictionary<string, byte[]> Of(TextAsset manifest, params TextAsset[] others) =>
      Of(manifest, out _, others);

  /// <summary>The same with the package's <paramref name="digest"/>.</summary>
  /// <exception cref="InputError">As above.</exception>
  public static Dictionary<string, byte[]> Of(TextAsset manifest, out string digest, params TextAsset[] others) {
    if (manifest == null) {
      throw new InputError($"Manifest File: found none, expected {Manifest}");
    }
    var files = new Dictionary<string, byte[]> { [Manifest] = manifest.bytes };
    var digests = new JsonBlock(Json.Read(manifest.bytes, Manifest), Manifest).Block("sha256");
    foreach (var asset in others) {
      if (asset == null) {
        throw new InputError("files: found an empty field, expected the files that its tooltip names");
      }
      files[PathOf(asset.name, digests)] = asset.bytes;
    }
    digest = Unpacked.PartDigest(files);
    return files;
  }

  private static string PathOf(string name, JsonBlock digests) {
    foreach (string path in digests.Names) {
      if (path.EndsWith($"/{name}.bytes", StringComparison.Ordinal)
          || path.EndsWith($"/{name}.json", StringComparison.Ordinal)) {
        return path;
      }
    }
    throw new InputError($"{name}: found no file of that name in the manifest, expected those of one package");
  }
}
}
