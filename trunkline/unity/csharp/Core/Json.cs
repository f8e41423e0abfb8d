using System.Collections.Generic;
using System.Globalization;
using System.Text;

namespace Trunkline {

/// <summary>Reads JSON: the package's manifest and its shared vectors. An object is a Dictionary, a list a List, a
/// number a double.</summary>
public sealed class Json {
  private readonly string _text, _source;
  private int _at;

  private Json(string text, string source) {
    _text = text;
    _source = source;
  }

  /// <summary>What <paramref name="text"/> says; <paramref name="source"/>: where it is from, for messages.</summary>
  /// <exception cref="InputError">It is no JSON.</exception>
  public static object Read(string text, string source) {
    var reader = new Json(text, source);
    object value = reader.Value();
    reader.Space();
    if (reader._at < text.Length) {
      throw reader.Error();
    }
    return value;
  }

  /// <summary>Of a file's contents in UTF-8.</summary>
  public static object Read(byte[] text, string source) => Read(Encoding.UTF8.GetString(text), source);

  private InputError Error() => new InputError($"{_source}: found no JSON at character {_at}, expected some");

  private void Space() {
    while (_at < _text.Length && " \n\r\t".IndexOf(_text[_at]) >= 0) {
      _at++;
    }
  }

  private bool Comes(char letter) {
    Space();
    bool comes = _at < _text.Length && _text[_at] == letter;
    _at += comes ? 1 : 0;
    return comes;
  }

  private void Expect(char letter) {
    if (!Comes(letter)) {
      throw Error();
    }
  }

  private object Value() {
    Space();
    if (_at >= _text.Length) {
      throw Error();
    }
    switch (_text[_at]) {
      case '{': return Object();
      case '[': return List();
      case '"': return String();
      case 't': return Word("true", true);
      case 'f': return Word("false", false);
      case 'n': return Word("null", null);
      default: return Number();
    }
  }

  private object Word(string word, object value) {
    if (string.CompareOrdinal(_text, _at, word, 0, word.Length) != 0) {
      throw Error();
    }
    _at += word.Length;
    return value;
  }

  private object Number() {
    int first = _at;
    while (_at < _text.Length && "+-.0123456789eE".IndexOf(_text[_at]) >= 0) {
      _at++;
    }
    string digits = _text.Substring(first, _at - first);
    if (!double.TryParse(digits, NumberStyles.Float, CultureInfo.InvariantCulture, out double value)) {
      throw Error();
    }
    return value;
  }

  private object Object() {
    var found = new Dictionary<string, object>();
    Expect('{');
    if (Comes('}')) {
      return found;
    }
    do {
      Space();
      string name = String();
      Expect(':');
      found[name] = Value();
    } while (Comes(','));
    Expect('}');
    return found;
  }

  private object List() {
    var found = new List<object>();
    Expect('[');
    if (Comes(']')) {
      return found;
    }
    do {
      found.Add(Value());
    } while (Comes(','));
    Expect(']');
    return found;
  }

  private string String() {
    Expect('"');
    int first = _at - 1;
    var found = new StringBuilder();
    while (true) {
      if (_at >= _text.Length) {
        _at = first;
        throw Error();
      }
      char letter = _text[_at++];
      if (letter == '"') {
        return found.ToString();
      }
      found.Append(letter == '\\' ? Escaped() : letter);
    }
  }

  private char Escaped() {
    if (_at >= _text.Length) {
      throw Error();
    }
    char letter = _text[_at++];
    switch (letter) {
      case 'n': return '\n';
      case 't': return '\t';
      case 'r': return '\r';
      case 'b': return '\b';
      case 'f': return '\f';
      case 'u': break;
      default: return letter;
    }
    if (_at + 4 > _text.Length || !int.TryParse(_text.Substring(_at, 4), NumberStyles.HexNumber,
        CultureInfo.InvariantCulture, out int code)) {
      throw Error();
    }
    _at += 4;
    return (char)code;
  }
}

/// <summary>One object of a JSON file, and where it is, so that what is missing is named.</summary>
public readonly struct JsonBlock {
  private readonly Dictionary<string, object> _values;
  private readonly string _source;

  /// <param name="value">Of <see cref="Json.Read(string, string)"/>.</param>
  /// <param name="source">Where it is from, for messages.</param>
  /// <exception cref="InputError">It is no object. All below throw one too where what they are asked for is missing or
  /// something else.</exception>
  public JsonBlock(object value, string source) {
    _source = source;
    _values = value as Dictionary<string, object> ?? throw new InputError($"{source}: found no block, expected one");
  }

  /// <summary>Of all that is in it.</summary>
  public IEnumerable<string> Names => _values.Keys;

  /// <summary>Whether there is one that is not null.</summary>
  public bool Has(string name) => _values.TryGetValue(name, out object value) && value != null;

  /// <summary>An object in it.</summary>
  public JsonBlock Block(string name) => new JsonBlock(Raw(name), $"{_source}: {name}");

  /// <summary>A number in it.</summary>
  public double Number(string name) => Raw(name) is double value ? value : throw Missing(name, "a number");

  /// <summary>A whole number of 1 or more.</summary>
  public int Count(string name) {
    double value = Number(name);
    return IsCount(value) ? (int)value : throw Missing(name, "a whole number from 1");
  }

  /// <summary>So many whole numbers of 1 or more.</summary>
  public int[] Counts(string name, int count) {
    var values = Numbers(name, count);
    foreach (double value in values) {
      if (!IsCount(value)) {
        throw Missing(name, $"{count} whole numbers from 1");
      }
    }
    return System.Array.ConvertAll(values, value => (int)value);
  }

  private static bool IsCount(double value) => value >= 1 && value <= 1 << 30 && value == System.Math.Floor(value);

  /// <summary>A text in it.</summary>
  public string Text(string name) => Raw(name) as string ?? throw Missing(name, "a text");

  /// <summary>A list of numbers in it; so many, where <paramref name="count"/> says.</summary>
  public double[] Numbers(string name, int count = 0) {
    string expected = count > 0 ? $"{count} numbers" : "numbers";
    var found = new List<double>();
    foreach (object value in List(name, expected)) {
      found.Add(value is double number ? number : throw Missing(name, expected));
    }
    return count > 0 && found.Count != count ? throw Missing(name, expected) : found.ToArray();
  }

  /// <summary>A list of texts in it, one at least.</summary>
  public string[] Texts(string name) {
    var found = new List<string>();
    foreach (object value in List(name, "texts")) {
      found.Add(value as string ?? throw Missing(name, "texts"));
    }
    return found.Count == 0 ? throw Missing(name, "texts") : found.ToArray();
  }

  private List<object> List(string name, string expected) =>
      Raw(name) as List<object> ?? throw Missing(name, expected);

  private object Raw(string name) =>
      _values.TryGetValue(name, out object value) ? value
          : throw new InputError($"{_source}: found no {name}, expected one");

  private InputError Missing(string name, string expected) =>
      new InputError($"{_source}: {name}: found something else, expected {expected}");
}
}
