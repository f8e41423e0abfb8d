// A stub of NUnit 3 as Unity's test framework brings it: the signatures that the Unity package's tests use.

using System;

namespace NUnit.Framework {

public delegate void TestDelegate();

[AttributeUsage(AttributeTargets.Method)]
public class OneTimeSetUpAttribute : Attribute {}

[AttributeUsage(AttributeTargets.Method, AllowMultiple = true)]
public class TestCaseAttribute : Attribute {
  public readonly object[] Arguments;

  public TestCaseAttribute(object arg) {
    Arguments = new[] { arg };
  }
}

public class Assert {
  public static void DoesNotThrow(TestDelegate code) => code();
}
}
