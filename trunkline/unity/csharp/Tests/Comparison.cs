using System;
using System.Collections.Generic;
using System.Globalization;

namespace Trunkline.Tests {

/// <summary>What was answered beside what Python answered, both as JSON: words alike, numbers within a share of
/// themselves, and within an absolute bound where they are nearly 0.</summary>
internal sealed class Comparison {
  private readonly double _relative, _absolute;

  public Comparison(double relative = 1e-5, double absolute = 1e-9) {
    _relative = relative;
    _absolute = absolute;
  }

  /// <summary>The greatest of |found - expected| / max(|expected|, 1e-4).</summary>
  public double Greatest { get; private set; }
  public int Numbers { get; private set; }

  /// <summary>Throws an InputError that names the first disagreement.</summary>
  public void Of(string where, object expected, object found) {
    if (expected is Dictionary<string, object> block && found is Dictionary<string, object> other) {
      foreach (var entry in block) {
        if (!other.ContainsKey(entry.Key)) {
          throw new InputError($"{where}: found no {entry.Key}");
        }
        Of($"{where}.{entry.Key}", entry.Value, other[entry.Key]);
      }
      Same(where, block.Count, other.Count);
    } else if (expected is List<object> list && found is List<object> others) {
      Same(where, list.Count, others.Count);
      for (int i = 0; i < list.Count; i++) {
        Of($"{where}[{i}]", list[i], others[i]);
      }
    } else if (expected is double number && found is double value) {
      double off = Math.Abs(value - number);
      if (!(off <= Math.Max(_relative * Math.Abs(number), _absolute))) {
        throw new InputError($"{where}: found {Digits(value)}, expected {Digits(number)}");
      }
      Greatest = Math.Max(Greatest, off / Math.Max(Math.Abs(number), _absolute / _relative));
      Numbers++;
    } else {
      Same(where, expected, found);
    }
  }

  private static string Digits(double value) => value.ToString("R", CultureInfo.InvariantCulture);

  private static void Same(string where, object expected, object found) {
    if (!Equals(expected, found)) {
      throw new InputError($"{where}: found {found ?? "null"}, expected {expected ?? "null"}");
    }
  }
}
}
