using System;

namespace Trunkline {

/// <summary>A user's mistake: a damaged package, a target that is none. The message is one line that says what was
/// found and what was expected, in the words of trunkline/errors.py and what raises it there.</summary>
public sealed class InputError : Exception {
  /// <summary>One line: file or key, what was found, what was expected.</summary>
  public InputError(string message) : base(message) {}
}
}
