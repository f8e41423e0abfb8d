using System;
using System.Collections.Generic;
using UnityEngine;

namespace Trunkline {

/// <summary>Files of the package by their paths in it, as the core takes them, from text assets: as such Unity imports
/// `.json` and `.bytes`. Nothing is read from StreamingAssets.</summary>
public static class PackageFiles {
  /// <summary>The manifest and `others`; each is known by its name and lies where the manifest says.</summary>
  /// <param name="said">The manifest as read, for <see cref="Unpacked"/>: it is long, and read here alone.</param>
  /// <param name="digest">The package's.</param>
  /// <exception cref="InputError">One is missing in the component's fields, is none of the package's, or is of another
  /// version of it.</exception>
  public static Dictionary<string, byte[]> Of(TextAsset manifest, out JsonBlock said, out string digest,
                                              params TextAsset[] others) {
    if (manifest == null) {
      throw new InputError($"Manifest File: found none, expected {Unpacked.Manifest}");
    }
    var files = new Dictionary<string, byte[]> { [Unpacked.Manifest] = manifest.bytes };
    said = Unpacked.ManifestOf(files);
    var digests = said.Block("sha256");
    foreach (var asset in others) {
      if (asset == null) {
        throw new InputError("files: found an empty field, expected the files that its tooltip names");
      }
      files[PathOf(asset.name, digests)] = asset.bytes;
    }
    digest = Unpacked.PartDigest(files, said);
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
