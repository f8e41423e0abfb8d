// Tests the package's C# core by the shared vectors of a package's folder:
//
//   mono vectors.exe FOLDER [--more FILE] [--time]
//
// FILE has cases of what the shared vectors leave out, in the same form. It prints a line a file, and ends with exit
// code 1 and one line at the first disagreement, or where the package is not sound.

using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;

namespace Trunkline.Tests {

internal static class Program {
  public static int Main(string[] given) {
    CultureInfo.DefaultThreadCurrentCulture = CultureInfo.CurrentCulture = CultureInfo.GetCultureInfo("de-DE");
    try {
      var files = FilesIn(given[0]);
      Unpacked.PackageDigest(files, Unpacked.ManifestOf(files));
      var shared = new SharedVectors(files);
      foreach (string name in SharedVectors.Names) {
        Console.WriteLine(shared.Test(name));
      }
      for (int i = 1; i < given.Length; i++) {
        if (given[i] == "--more") {
          string more = given[++i];
          new More(files, shared).Test(Messages.Block(Json.Read(File.ReadAllBytes(more), more)));
        } else {
          new Timing(files, shared).Tell();
        }
      }
      return 0;
    } catch (InputError error) {
      Console.WriteLine($"error: {error.Message}");
      return 1;
    }
  }

  private static Dictionary<string, byte[]> FilesIn(string folder) {
    var files = new Dictionary<string, byte[]>();
    foreach (string path in Directory.GetFiles(folder, "*", SearchOption.AllDirectories)) {
      files[path.Substring(folder.Length).TrimStart('/')] = File.ReadAllBytes(path);
    }
    return files;
  }
}
}
