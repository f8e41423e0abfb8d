using System;
using System.Collections.Generic;

namespace Trunkline.Tests {

/// <summary>JSON read into objects by the names of their fields, as Unity's JsonUtility does.</summary>
internal static class ReadAs {
  public static object Text(string json, Type type) {
    try {
      return Filled(Json.Read(json, "json"), type);
    } catch (InputError error) {
      throw new ArgumentException($"JSON parse error: {error.Message}");
    }
  }

  private static object Filled(object given, Type type) {
    if (given is List<object> list && type.IsArray) {
      var array = Array.CreateInstance(type.GetElementType(), list.Count);
      for (int i = 0; i < list.Count; i++) {
        array.SetValue(Filled(list[i], type.GetElementType()), i);
      }
      return array;
    }
    if (given is Dictionary<string, object> block && type != typeof(string)) {
      object made = Activator.CreateInstance(type);
      foreach (var field in type.GetFields()) {
        if (block.TryGetValue(field.Name, out object value)) {
          field.SetValue(made, Filled(value, field.FieldType));
        }
      }
      return made;
    }
    return given is double ? Convert.ChangeType(given, type) : given;
  }
}
}
