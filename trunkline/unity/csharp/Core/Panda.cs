using System;

namespace Trunkline {

/// <summary>The Franka Emika Panda's published geometry: trunkline/kinematics/panda/kinematics.py.</summary>
public static class Panda {
  /// <summary>Modified Denavit-Hartenberg parameters: m, m, rad.</summary>
  internal static readonly double[] A = { 0, 0, 0, 0.0825, -0.0825, 0, 0.088 };
  internal static readonly double[] D = { 0.333, 0, 0.316, 0, 0.384, 0, 0 };
  internal static readonly double[] Alpha = {
    0, -Math.PI / 2, Math.PI / 2, Math.PI / 2, -Math.PI / 2, Math.PI / 2, Math.PI / 2,
  };

  /// <summary>m, from frame 7 to the flange along z.</summary>
  public const double Flange = 0.107;

  /// <summary>Lower limit of joint 7, rad.</summary>
  public const double WristLeast = -2.8973;

  /// <summary>Upper limit of joint 7, rad.</summary>
  public const double WristMost = 2.8973;
}
}
