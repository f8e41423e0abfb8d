namespace Trunkline {

/// <summary>What is told of a target's reach: where a point is, how far outside, m, and the nearest reachable point, m,
/// where it is outside. Port of trunkline/ar/teleop/reach_message.py.</summary>
public readonly struct Reading {
  /// <summary>Inside or outside, or unknown.</summary>
  public readonly Where Where;
  /// <summary>m; 0 unless outside.</summary>
  public readonly double OutsideBy;
  /// <summary>m, in the frame in which the point was asked about; null where there is none.</summary>
  public readonly Vector? Offer;

  /// <summary>As the fields of the same names.</summary>
  public Reading(Where where, double outsideBy = 0, Vector? offer = null) {
    Where = where;
    OutsideBy = outsideBy;
    Offer = offer;
  }

  internal Reading WithOffer(Vector? offer) => new Reading(Where, OutsideBy, offer);
}
}
