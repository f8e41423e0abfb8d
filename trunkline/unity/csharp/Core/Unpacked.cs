using System;
using System.Collections.Generic;
using System.Security.Cryptography;
using System.Text;

namespace Trunkline {

/// <summary>A finished package, read back: its digest, its maps in the base frames, what its network takes. Port of
/// trunkline/unity/unpacked.py. Files are contents by path in the package; the manifest is read once, by
/// <see cref="ManifestOf"/>, and handed on.</summary>
public static class Unpacked {
  /// <summary>Where the manifest is in the package.</summary>
  public const string Manifest = "Runtime/manifest.json";

  private static readonly double[] _powers = PowersOfTwo();  // of the last bit of a number of 16 bits, by its exponent

  /// <summary>The manifest of <paramref name="files"/>, for all that is asked of them.</summary>
  /// <exception cref="InputError">There is none, or it is no JSON.</exception>
  public static JsonBlock ManifestOf(IReadOnlyDictionary<string, byte[]> files) {
    if (!files.TryGetValue(Manifest, out var text)) {
      throw new InputError($"package: found no {Manifest}, expected one of the stage package_unity");
    }
    return new JsonBlock(Json.Read(text, Manifest), Manifest);
  }

  /// <summary>SHA-256 of the manifest, which has that of every other file: of another package, another
  /// digest.</summary>
  /// <exception cref="InputError">Naming the file that is not the one that the manifest means, or that it does not
  /// list.</exception>
  public static string PackageDigest(IReadOnlyDictionary<string, byte[]> files, JsonBlock manifest) {
    var digests = manifest.Block("sha256");
    foreach (string path in digests.Names) {
      Require(path, files.TryGetValue(path, out var data) ? Digest(data) : "none", digests.Text(path));
    }
    return PartDigest(files, manifest);
  }

  /// <summary>The same of an app that brings some of the package's files: those that it brings are tested.</summary>
  /// <exception cref="InputError">Naming the file that is not the one that the manifest means.</exception>
  public static string PartDigest(IReadOnlyDictionary<string, byte[]> files, JsonBlock manifest) {
    var digests = manifest.Block("sha256");
    foreach (var file in files) {
      if (file.Key != Manifest) {
        Require(file.Key, Digest(file.Value), digests.Has(file.Key) ? digests.Text(file.Key) : "none");
      }
    }
    return Digest(files[Manifest]);
  }

  private static void Require(string path, string found, string expected) {
    if (found != expected) {
      throw new InputError($"{path}: found sha256 {Formats.First(found, 12)}, expected "
          + $"{Formats.First(expected, 12)} as the manifest says");
    }
  }

  /// <summary>The maps of the package's reach. Where it has sheets, the soft grids may be left out.</summary>
  /// <exception cref="InputError">A file is missing, or not of the lattice that the manifest says.</exception>
  public static MapReach MapsOf(IReadOnlyDictionary<string, byte[]> files, JsonBlock manifest) {
    RequireOneLattice(manifest);
    var grids = manifest.Block("reach").Has("sheets") ? null : GridsOf(files, manifest);
    var rigid = Grid(files, manifest.Block("grids"), "rigid");
    return new MapReach(rigid, (ISoftReach)grids ?? SheetsOf(files, manifest));
  }

  /// <summary>The tip's reach by the soft grids, for gravity of one tilt.</summary>
  /// <exception cref="InputError">As for <see cref="MapsOf"/>.</exception>
  public static TiltReach GridsOf(IReadOnlyDictionary<string, byte[]> files, JsonBlock manifest) {
    JsonBlock reach = manifest.Block("reach"), grids = manifest.Block("grids");
    RequireOneLattice(manifest);
    var maps = Array.ConvertAll(reach.Texts("grids"), name => Grid(files, grids, name));
    return new TiltReach(maps, reach.Numbers("angles"));
  }

  private static void RequireOneLattice(JsonBlock manifest) {
    var names = manifest.Block("reach").Texts("grids");
    var grids = manifest.Block("grids");
    foreach (string name in names) {
      foreach (string key in new[] { "shape", "origin", "spacing" }) {
        if (!Same(grids.Block(name).Numbers(key), grids.Block(names[0]).Numbers(key))) {
          throw new InputError($"{name}: found another {key} than that of {names[0]}, expected one lattice for all "
              + "soft maps");
        }
      }
    }
  }

  /// <summary>The surface of the soft arm's tips; null in a package for gravity of one tilt.</summary>
  /// <exception cref="InputError">A file is missing, or of another size.</exception>
  public static SheetReach SheetsOf(IReadOnlyDictionary<string, byte[]> files, JsonBlock manifest) {
    var reach = manifest.Block("reach");
    return reach.Has("sheets") ? Sheets(files, reach.Block("sheets"), reach.Number("tolerance")) : null;
  }

  /// <summary>The package's inverse kinematics by a <paramref name="network"/> that runs its file.</summary>
  /// <exception cref="InputError">The network is of other inputs or outputs.</exception>
  public static ArmKinematics KinematicsOf(JsonBlock manifest, INetwork network) {
    JsonBlock block = manifest.Block("network"), lengths = manifest.Block("model").Block("rest_lengths");
    var tendons = block.Texts("output_order");
    var rest = Array.ConvertAll(tendons, lengths.Number);
    Sure sure = null;
    if (block.Has("sure")) {
      var limits = block.Block("sure");
      sure = new Sure(limits.Number("pulls"), limits.Number("tilt"), limits.Number("pulled_tilt"));
    }
    return new ArmKinematics(network, block.Texts("input_order"), tendons, rest, block.Number("doubt_beyond"), sure);
  }

  private static bool Same(double[] one, double[] other) {
    bool same = one.Length == other.Length;
    for (int i = 0; same && i < one.Length; i++) {
      same = one[i] == other[i];
    }
    return same;
  }

  private static SignedMap Grid(IReadOnlyDictionary<string, byte[]> files, JsonBlock grids, string name) {
    var block = grids.Block(name);
    var shape = block.Counts("shape", 3);  // along Unity's axes, x fastest
    double[] origin = block.Numbers("origin", 3), spacing = block.Numbers("spacing", 3);
    int nx = shape[0], ny = shape[1], nz = shape[2];
    var values = Halves(files, block.Text("file"), (decimal)nx * ny * nz);
    return new SignedMap(values, nx, nz, ny, new Vector(origin[0], origin[2], origin[1]), spacing[0]);
  }

  private static SheetReach Sheets(IReadOnlyDictionary<string, byte[]> files, JsonBlock block, double tolerance) {
    int count = Math.Max(block.Numbers("directions").Length / 3, 1);
    var directions = block.Numbers("directions", 3 * count);
    int around = block.Count("around"), along = block.Count("along");
    var downs = new Vector[count];
    for (int j = 0; j < count; j++) {
      downs[j] = new Vector(directions[3 * j], directions[3 * j + 2], directions[3 * j + 1]);
    }
    var points = Halves(files, block.Text("file"), (decimal)count * around * along * 3);
    for (int i = 0; i < points.Length; i += 3) {
      Exchange(ref points[i + 1], ref points[i + 2]);
    }
    var matrix = Doubles(files, block.Text("weights"), count * (count + 4));
    for (int end = count + 4; end <= matrix.Length; end += count + 4) {
      Exchange(ref matrix[end - 2], ref matrix[end - 1]);  // the last columns are of g itself
    }
    return new SheetReach(points, downs, matrix, around, along, tolerance);
  }

  private static void Exchange<T>(ref T a, ref T b) {
    T kept = a;
    a = b;
    b = kept;
  }

  private static float[] Halves(IReadOnlyDictionary<string, byte[]> files, string path, decimal count) {
    var data = Contents(files, path, 2 * count);
    var found = new float[data.Length / 2];
    for (int i = 0; i < found.Length; i++) {
      found[i] = Half(data[2 * i] | data[2 * i + 1] << 8);
    }
    return found;
  }

  // IEEE 754 binary16: sign, 5 bits of exponent, 10 of fraction.
  private static float Half(int bits) {
    int exponent = bits >> 10 & 31, fraction = bits & 1023;
    double value = exponent == 31 ? (fraction == 0 ? double.PositiveInfinity : double.NaN)
        : (exponent == 0 ? fraction : 1024 + fraction) * _powers[Math.Max(exponent, 1)];
    return (float)((bits & 0x8000) != 0 ? -value : value);
  }

  private static double[] PowersOfTwo() {
    var found = new double[31];
    for (int exponent = 0; exponent < found.Length; exponent++) {
      found[exponent] = Math.Pow(2, exponent - 25);
    }
    return found;
  }

  private static double[] Doubles(IReadOnlyDictionary<string, byte[]> files, string path, int count) {
    var data = Contents(files, path, 8 * count);
    var found = new double[count];
    Buffer.BlockCopy(data, 0, found, 0, data.Length);  // little-endian, as are the machines that Unity runs on
    return found;
  }

  private static byte[] Contents(IReadOnlyDictionary<string, byte[]> files, string path, decimal size) {
    if (!files.TryGetValue(path, out var data) || data.Length != size) {
      string found = data == null ? "no such file" : $"found {data.Length} bytes";
      throw new InputError($"{path}: {found}, expected {size} as the manifest's lattice says");
    }
    return data;
  }

  // SHA-256 in hexadecimal digits.
  private static string Digest(byte[] data) {
    var found = new StringBuilder();
    using (var hash = SHA256.Create()) {
      foreach (byte one in hash.ComputeHash(data)) {
        found.Append(one.ToString("x2"));
      }
    }
    return found.ToString();
  }
}
}
