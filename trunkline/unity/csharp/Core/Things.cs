using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>Things as a grasp sees them: trunkline/ar/teleop/object_shapes.py, trunkline/ar/hybrid/basket.py.</summary>
public static class Things {
  private const double _handle = 0.1;  // of a basket's mass, in bar and posts

  /// <summary>The middle of what the arm wraps, base frame, m: a basket's bar, else the centre.</summary>
  public static Vector GripOf(Thing thing) => thing.Shape != Shape.Basket ? thing.Position : Add(
      thing.Position, Rotate(thing.Quaternion, new Vector(0, 0, BarHeight(thing.Basket, thing.Height))));

  /// <summary>m, of the bar's axis above the centre of mass; the box is <paramref name="height"/> m high.</summary>
  public static double BarHeight(Basket basket, double height) =>
      height / 2 + basket.Rise - CentreHeight(basket, height);

  /// <summary>m, of the centre of mass above that of the box.</summary>
  public static double CentreHeight(Basket basket, double height) {
    double rod = _handle / (basket.Length + 2 * basket.Rise), top = height / 2;
    return rod * (basket.Length * (top + basket.Rise) + 2 * basket.Rise * (top + basket.Rise / 2));
  }
}
}
