using System;
using System.Globalization;

namespace Trunkline {

/// <summary>Numbers in messages, as Python's format specifications write them.</summary>
internal static class Formats {
  private const double _largest = 1e20;  // beyond which a decimal may not hold it

  /// <summary><c>{value:.&lt;digits&gt;g}</c>.</summary>
  public static string General(double value, int digits = 6) {
    if (NotFinite(value) is string word) {
      return word;
    }
    if (value == 0) {
      return double.IsNegativeInfinity(1 / value) ? "-0" : "0";
    }
    return value.ToString("g" + digits, CultureInfo.InvariantCulture);
  }

  /// <summary><c>{value:.&lt;digits&gt;f}</c>: exact halves go to the even digit.</summary>
  public static string Fixed(double value, int digits) {
    if (NotFinite(value) is string word) {
      return word;
    }
    if (Math.Abs(value) > _largest) {
      return value.ToString("F" + digits, CultureInfo.InvariantCulture);
    }
    string every = value.ToString("G17", CultureInfo.InvariantCulture);  // tells which side of a half it is on
    decimal exact = decimal.Parse(every, NumberStyles.Float, CultureInfo.InvariantCulture);
    return Math.Round(exact, digits, MidpointRounding.ToEven).ToString("F" + digits, CultureInfo.InvariantCulture);
  }

  /// <summary>The first <paramref name="count"/> characters: <c>text[:count]</c>.</summary>
  public static string First(string text, int count) => text.Length <= count ? text : text.Substring(0, count);

  private static string NotFinite(double value) {
    if (double.IsNaN(value)) {
      return "nan";
    }
    return double.IsInfinity(value) ? (value > 0 ? "inf" : "-inf") : null;
  }
}
}
