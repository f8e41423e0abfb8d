// What the soft arm reaches under the gravity that pulls on it now, from any side.
//
// manifest.json's reach.sheets says what the two files hold: under some directions of gravity g_j the surface of the
// arm's tips, as a lattice of points p_j, and a matrix M. Under gravity g the surface is the sum of w_j p_j with
//   w = M [ |g - g_1|^3, ..., |g - g_D|^3, 1, g ].
// A position is within reach if the surface is nearer than reach.tolerance. All of it in the frame of the model's body
// `base`, in Unity's axes; put this component on that object.

using System;
using UnityEngine;

namespace Trunkline {

[AddComponentMenu("Trunkline/Soft Reach")]
[DisallowMultipleComponent]
public class SoftReach : MonoBehaviour {

  [Tooltip("Runtime/manifest.json of this package.")]
  public TextAsset ManifestFile;

  [Tooltip("Runtime/Reachability/sheets.bytes of this package.")]
  public TextAsset PointsFile;

  [Tooltip("Runtime/Reachability/sheet_weights.bytes of this package.")]
  public TextAsset WeightsFile;

  // The part of the manifest that is read. JsonUtility goes by these names and skips all others.
  [Serializable]
  public class Manifest {
    public Reach reach;
  }

  [Serializable]
  public class Reach {
    public float tolerance;
    public Sheets sheets;
  }

  [Serializable]
  public class Sheets {
    public double[] directions;
    public int around;
    public int along;
  }

  // Points of the surface under the gravity that was last given, one way around the arm after the other.
  public Vector3[] Points { get; private set; }

  private const float _same = 1e-4f;  // of a unit vector: gravity that has turned less leaves the surface as it is

  private Reach _reach;
  private float[] _known;
  private double[] _matrix;
  private Vector3 _down;

  // The direction of gravity as the network takes it: base frame, unit length. The sensor is the scene's own gravity.
  public static Vector3 NetworkGravity(Transform armBase) {
    var down = DownOf(armBase);
    return new Vector3(down.x, down.z, down.y);
  }

  // The same in Unity's axes, as this component takes it.
  public static Vector3 DownOf(Transform armBase) {
    return armBase.InverseTransformDirection(Physics.gravity).normalized;
  }

  protected void Awake() {
    if (ManifestFile == null || PointsFile == null || WeightsFile == null) {
      Debug.LogError("Soft Reach: found no Manifest File, Points File or Weights File, expected all three", this);
      enabled = false;
      return;
    }
    _reach = JsonUtility.FromJson<Manifest>(ManifestFile.text).reach;
    var points = PointsFile.bytes;
    _known = new float[points.Length / 2];
    for (int i = 0; i < _known.Length; i++) {
      _known[i] = Mathf.HalfToFloat((ushort)(points[2 * i] | points[2 * i + 1] << 8));
    }
    var weights = WeightsFile.bytes;
    _matrix = new double[weights.Length / 8];
    Buffer.BlockCopy(weights, 0, _matrix, 0, weights.Length);
    Points = new Vector3[_reach.sheets.around * _reach.sheets.along];
    if (_known.Length != _reach.sheets.directions.Length * Points.Length) {
      Debug.LogError($"Soft Reach: found {_known.Length} numbers in {PointsFile.name}, expected "
          + $"{_reach.sheets.directions.Length * Points.Length}: all files of one package", this);
      enabled = false;
      return;
    }
    SetGravity(DownOf(transform));
  }

  protected void Update() {
    SetGravity(DownOf(transform));
  }

  // The surface under gravity in the direction `down`, of unit length, in Unity's axes.
  public void SetGravity(Vector3 down) {
    if ((down - _down).sqrMagnitude < _same * _same) {
      return;
    }
    _down = down;
    var directions = _reach.sheets.directions;
    int count = directions.Length / 3, columns = count + 4;
    var terms = new double[columns];
    for (int j = 0; j < count; j++) {
      double x = down.x - directions[3 * j], y = down.y - directions[3 * j + 1], z = down.z - directions[3 * j + 2];
      double squared = x * x + y * y + z * z;
      terms[j] = squared * Math.Sqrt(squared);
    }
    terms[count] = 1;
    terms[count + 1] = down.x;
    terms[count + 2] = down.y;
    terms[count + 3] = down.z;
    Array.Clear(Points, 0, Points.Length);
    for (int j = 0; j < count; j++) {
      double weight = 0;
      for (int k = 0; k < columns; k++) {
        weight += _matrix[j * columns + k] * terms[k];
      }
      var share = (float)weight;
      int at = 3 * j * Points.Length;
      for (int i = 0; i < Points.Length; i++, at += 3) {
        Points[i].x += share * _known[at];
        Points[i].y += share * _known[at + 1];
        Points[i].z += share * _known[at + 2];
      }
    }
  }

  // About how far a position in the arm's base frame, in Unity's axes, is out of reach, m: above 0 it is. And the point
  // of the surface that is nearest to it.
  public float Signal(Vector3 position, out Vector3 nearest) {
    int around = _reach.sheets.around, along = _reach.sheets.along;
    float least = float.PositiveInfinity;
    nearest = position;
    for (int ray = 0; ray < around; ray++) {
      int here = ray * along, beside = (ray + 1) % around * along;
      for (int step = 0; step + 1 < along; step++) {
        var a = Points[here + step];
        var b = Points[here + step + 1];
        var c = Points[beside + step + 1];
        var d = Points[beside + step];
        Try(position, Nearest(position, a, b, c), ref least, ref nearest);
        Try(position, Nearest(position, a, c, d), ref least, ref nearest);
      }
    }
    return Mathf.Sqrt(least) - _reach.tolerance;
  }

  private static void Try(Vector3 position, Vector3 candidate, ref float least, ref Vector3 nearest) {
    float squared = (candidate - position).sqrMagnitude;
    if (squared < least) {
      least = squared;
      nearest = candidate;
    }
  }

  // The point of triangle a b c nearest to p, by the region of the triangle that p is before
  // (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
  private static Vector3 Nearest(Vector3 p, Vector3 a, Vector3 b, Vector3 c) {
    Vector3 ab = b - a, ac = c - a, ap = p - a;
    float d1 = Vector3.Dot(ab, ap), d2 = Vector3.Dot(ac, ap);
    if (d1 <= 0 && d2 <= 0) {
      return a;
    }
    var bp = p - b;
    float d3 = Vector3.Dot(ab, bp), d4 = Vector3.Dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) {
      return b;
    }
    float vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
      return a + d1 / (d1 - d3) * ab;
    }
    var cp = p - c;
    float d5 = Vector3.Dot(ab, cp), d6 = Vector3.Dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) {
      return c;
    }
    float vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
      return a + d2 / (d2 - d6) * ac;
    }
    float va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
      return b + (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b);
    }
    float whole = va + vb + vc;
    return a + vb / whole * ab + vc / whole * ac;
  }
}
}
