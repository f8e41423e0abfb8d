using System;
using System.Collections.Generic;
using static Trunkline.Vectors;

namespace Trunkline {

/// <summary>What runs the file of the package's network: Unity's inference engine, ONNX's runtime.</summary>
public interface INetwork {
  /// <summary>How many numbers its input takes, 8 or 10.</summary>
  int Inputs { get; }

  /// <summary>How many its outputs give: commands, lengths, tip.</summary>
  IReadOnlyList<int> Outputs { get; }

  /// <summary>What it answers to so many <paramref name="poses"/>, one after the other: by the output's name, one
  /// answer after the other.</summary>
  IReadOnlyDictionary<string, float[]> Run(float[] poses, int count);
}

/// <summary>What the network answers of one pose: the motors' commands and the tendons' path lengths, m, in the order
/// of network.output_order, where the tip will come to rest, m, base frame, whether that is so far from its target
/// that the arm cannot take the pose, and whether the arm's tip may be further from there than 1 % of its length.</summary>
public sealed class Answer {
  /// <summary>m, one a tendon. They are no pulls: <see cref="ArmKinematics.PullsOf"/> makes these of them.</summary>
  public readonly double[] Commands;
  /// <summary>Path lengths at rest, m, one a tendon.</summary>
  public readonly double[] Lengths;
  /// <summary>Soft arm's base frame, m.</summary>
  public readonly Vector Tip;
  /// <summary>The tip is further from its target than the manifest's network.doubt_beyond.</summary>
  public readonly bool Doubtful;
  /// <summary>The motors pull by more, or the mount is tilted further, than network.sure of the manifest has it; true where
  /// it has nothing.</summary>
  public readonly bool Unsure;

  /// <summary>As the fields of the same names.</summary>
  public Answer(double[] commands, double[] lengths, Vector tip, bool doubtful, bool unsure) {
    Commands = commands;
    Lengths = lengths;
    Tip = tip;
    Doubtful = doubtful;
    Unsure = unsure;
  }
}

/// <summary>Up to where the certificate has the arm's tip within 1 % of its length from its twin's: the manifest's
/// network.sure.</summary>
public sealed class Sure {
  private const double _pulled = 1e-3;  // m, from which on a tendon counts as pulled
  private const double _sameTilt = 0.01;  // deg, of rounding

  private readonly double _pulls, _tilt, _pulledTilt;

  /// <param name="pulls">m, of all motors together.</param>
  /// <param name="tilt">deg, of the mount, where no motor pulls.</param>
  /// <param name="pulledTilt">deg, of the mount, where one does.</param>
  public Sure(double pulls, double tilt, double pulledTilt) {
    _pulls = pulls;
    _tilt = tilt;
    _pulledTilt = pulledTilt;
  }

  /// <summary>Whether it vouches for <paramref name="commands"/>, m, of tendons that are <paramref name="straight"/> m long
  /// in the straight arm, the mount tilted by <paramref name="tilt"/> deg.</summary>
  public bool Holds(IReadOnlyList<double> commands, IReadOnlyList<double> straight, double tilt) {
    double sum = 0, most = 0;
    for (int tendon = 0; tendon < commands.Count; tendon++) {
      double pull = Math.Max(straight[tendon] - commands[tendon], 0);
      sum += pull;
      most = Math.Max(most, pull);
    }
    return sum <= _pulls && tilt <= (most > _pulled ? _pulledTilt : _tilt) + _sameTilt;
  }
}

/// <summary>Gravity and tip to the motors' commands, by the package's network. Port of trunkline/kinematics/ik/inference.py and of
/// trunkline/ar/teleop/tendons.py but for its correction by the arm's statics.</summary>
public sealed class ArmKinematics {
  private const double _unit = 1e-3;  // by which the length of a quaternion or direction may differ from 1
  private const int _tilt = 8;  // inputs of a network that is told an angle of gravity, not its direction
  private const int _bends = 331;  // of the tip in its plane, from -330° on, 2° apart

  private readonly INetwork _network;
  private readonly IReadOnlyList<string> _inputs;
  private readonly IReadOnlyList<double> _restLengths;
  private readonly int _tendons;
  private readonly double _doubtBeyond;
  private readonly Sure _sure;
  private double[][] _poses;  // of Bend, filled anew at each

  /// <param name="network">Runs the package's file.</param>
  /// <param name="inputs">Names of its inputs: the manifest's network.input_order.</param>
  /// <param name="tendons">Names of the columns of commands and lengths: network.output_order.</param>
  /// <param name="restLengths">m, of each of them, the arm straight: model.rest_lengths.</param>
  /// <param name="doubtBeyond">m: network.doubt_beyond.</param>
  /// <param name="sure">network.sure; null where the manifest has none.</param>
  /// <exception cref="InputError">The network is of other inputs or outputs.</exception>
  public ArmKinematics(INetwork network, IReadOnlyList<string> inputs, IReadOnlyList<string> tendons,
                       IReadOnlyList<double> restLengths, double doubtBeyond, Sure sure) {
    var outputs = network.Outputs;
    int count = tendons.Count;
    bool known = outputs.Count == 3 && outputs[0] == count && outputs[1] == count && outputs[2] == 3;
    if (network.Inputs != inputs.Count || !known) {
      throw new InputError($"network: found inputs of width [{network.Inputs}] and outputs of width "
          + $"[{string.Join(", ", outputs)}], expected one input ({string.Join(", ", inputs)}) and commands and lengths"
          + $" of {string.Join(", ", tendons)}, and a tip");
    }
    _network = network;
    _inputs = inputs;
    _restLengths = restLengths;
    _tendons = count;
    _doubtBeyond = doubtBeyond;
    _sure = sure;
  }

  /// <summary>What the network answers of one pose: gravity (angle in rad, or a unit vector), tip position (m) and unit
  /// quaternion (w first, either sign) in the soft arm's base frame, as network.input_order names them.</summary>
  /// <exception cref="InputError">It is no pose, or the network has no finite answer.</exception>
  public Answer Ask(params double[] pose) => Ask(new[] { pose })[0];

  /// <summary>Of several poses at once, each as network.input_order names it; an answer each, in their order.</summary>
  /// <exception cref="InputError">One is no pose, or has no finite answer.</exception>
  public Answer[] Ask(double[][] poses) {
    var outputs = Run(poses);
    var found = new Answer[poses.Length];
    for (int row = 0; row < found.Length; row++) {
      found[row] = AnswerOf(outputs, row);
    }
    return found;
  }

  /// <summary>Commands that bring the tip to <paramref name="tip"/>, m, within <paramref name="tolerance"/> m, under
  /// <paramref name="gravity"/> (unit vector), all in the soft arm's base frame.
  ///
  /// The network wants a whole tip pose: it is asked for the target at many bends, and the answer is taken for which it
  /// foresees the tip nearest.</summary>
  /// <exception cref="InputError">No bend comes so near, or a network of one tilt is asked about gravity out of its
  /// plane.</exception>
  public Answer Bend(Vector tip, Vector gravity, double tolerance) {
    var found = Nearest(tip, gravity, out string refused) ?? throw new InputError(refused);
    double missed = Distance(found.Tip, tip);
    if (missed > tolerance) {
      throw new InputError("out of reach: the soft arm's tip comes no nearer to its target than "
          + $"{Formats.Fixed(1e3 * missed, 0)} mm");
    }
    return found;
  }

  /// <summary>The same for each frame: false where <see cref="Bend"/> refuses. The answer then is that whose tip comes
  /// nearest, and null under gravity that the network does not know.</summary>
  /// <exception cref="InputError">What is given is no number, or the network has no finite answer.</exception>
  public bool TryBend(Vector tip, Vector gravity, double tolerance, out Answer found) {
    found = Nearest(tip, gravity, out _);
    return found != null && Distance(found.Tip, tip) <= tolerance;
  }

  private Answer Nearest(Vector tip, Vector gravity, out string refused) {
    refused = null;
    return _inputs.Count == _tilt ? AtTilt(tip, gravity, out refused) : Asked(tip, gravity.X, gravity.Y, gravity.Z);
  }

  /// <summary>Commands as pulls, m: by how much each is shorter than the tendon when the arm is straight. These are the
  /// controls of the imported model's actuators.</summary>
  public double[] PullsOf(Answer answer) {
    var found = new double[_tendons];
    for (int i = 0; i < found.Length; i++) {
      found[i] = _restLengths[i] - answer.Commands[i];
    }
    return found;
  }

  private Answer Asked(Vector tip, params double[] told) {
    double plane = Math.Atan2(tip.Y, tip.X), x = -Math.Sin(plane), y = Math.Cos(plane);
    _poses = _poses ?? EmptyPoses();
    for (int i = 0; i < _bends; i++) {
      double half = Radians(-330 + 2 * i) / 2, cos = Math.Cos(half), sin = Math.Sin(half);
      var pose = _poses[i];
      told.CopyTo(pose, 0);
      int at = told.Length;
      pose[at] = tip.X;
      pose[at + 1] = tip.Y;
      pose[at + 2] = tip.Z;
      pose[at + 3] = cos;
      pose[at + 4] = sin * x;
      pose[at + 5] = sin * y;
    }
    var outputs = Run(_poses);
    int best = 0;
    for (int i = 1; i < _bends; i++) {
      best = Distance(outputs.Tip(i), tip) < Distance(outputs.Tip(best), tip) ? i : best;
    }
    return AnswerOf(outputs, best);
  }

  private double[][] EmptyPoses() {
    var poses = new double[_bends][];
    for (int i = 0; i < _bends; i++) {
      poses[i] = new double[_inputs.Count];
    }
    return poses;
  }

  // Of a network that knows tilts about +y alone: gravity in another tendon's plane is the same arm, turned.
  private Answer AtTilt(Vector tip, Vector gravity, out string refused) {
    refused = null;
    double level = Hypot(gravity.X, gravity.Y), angle = Math.Atan2(level, -gravity.Z);
    int turns = 0;
    if (angle > TiltReach.StraightDown) {
      double azimuth = Math.Atan2(gravity.Y, gravity.X);
      turns = (int)Math.Round(azimuth / TiltReach.Symmetry);
      double off = azimuth - turns * TiltReach.Symmetry;
      if (level * Math.Abs(Math.Sin(off)) > Math.Sin(TiltReach.Azimuth)) {
        refused = $"gravity: comes {Formats.Fixed(off * (180 / Math.PI), 0)}° beside a tendon's plane, which the "
            + "package does not know";
        return null;
      }
    }
    double cos = Math.Cos(turns * TiltReach.Symmetry), sin = Math.Sin(turns * TiltReach.Symmetry);
    var found = Asked(new Vector(cos * tip.X + sin * tip.Y, -sin * tip.X + cos * tip.Y, tip.Z), angle);
    var there = new Vector(cos * found.Tip.X - sin * found.Tip.Y, sin * found.Tip.X + cos * found.Tip.Y, found.Tip.Z);
    // A tendon that stands where another one did does what that one did.
    return new Answer(Rolled(found.Commands, turns), Rolled(found.Lengths, turns), there, found.Doubtful,
                      found.Unsure);
  }

  // What the network gave: rows of numbers, one after the other, and the poses that it was asked for.
  private struct Outputs {
    public float[] Asked, Commands, Lengths, Tips;

    public Vector Tip(int row) => new Vector(Tips[3 * row], Tips[3 * row + 1], Tips[3 * row + 2]);
  }

  private Outputs Run(double[][] poses) {
    var asked = Checked(poses);
    var answers = _network.Run(asked, poses.Length);
    return new Outputs {
      Asked = asked, Commands = Output(answers, "commands", _tendons, poses.Length),
      Lengths = Output(answers, "lengths", _tendons, poses.Length), Tips = Output(answers, "tip", 3, poses.Length),
    };
  }

  private Answer AnswerOf(Outputs outputs, int row) {
    var tip = outputs.Tip(row);
    int at = (row + 1) * _inputs.Count - 7;
    double missed = Distance(tip, new Vector(outputs.Asked[at], outputs.Asked[at + 1], outputs.Asked[at + 2]));
    var commands = Row(outputs.Commands, row);
    bool unsure = _sure == null || !_sure.Holds(commands, _restLengths, Tilt(outputs.Asked, row));
    return new Answer(commands, Row(outputs.Lengths, row), tip, missed > _doubtBeyond, unsure);
  }

  private double Tilt(float[] asked, int row) {  // of the mount against gravity, deg
    int first = row * _inputs.Count;
    if (_inputs.Count < _tilt) {
      return 0;
    }
    double angle = _inputs.Count == _tilt
        ? Math.Abs((double)asked[first])
        : Math.Atan2(Math.Sqrt((double)asked[first] * asked[first] + (double)asked[first + 1] * asked[first + 1]),
                     -(double)asked[first + 2]);
    return angle * 180 / Math.PI;
  }

  private static double[] Rolled(double[] values, int turns) {
    var found = new double[values.Length];
    for (int i = 0; i < found.Length; i++) {
      found[((i + turns) % found.Length + found.Length) % found.Length] = values[i];
    }
    return found;
  }

  // The poses in the network's precision, if they are poses.
  private float[] Checked(double[][] poses) {
    int width = _inputs.Count;
    var single = new float[poses.Length * width];
    foreach (var pose in poses) {
      if (pose.Length != width) {
        throw new InputError($"poses: found shape ({poses.Length}, {pose.Length}), expected (N, {width}): "
            + string.Join(", ", _inputs));
      }
    }
    for (int i = 0; i < single.Length; i++) {
      double value = poses[i / width][i % width];
      single[i] = (float)value;
      if (float.IsNaN(single[i]) || float.IsInfinity(single[i])) {
        throw new InputError($"pose {i / width}: {_inputs[i % width]}: found {Formats.General(value)}, expected a "
            + "finite number");
      }
    }
    RequireUnit("quaternion", poses, width - 4, 4);
    if (width > _tilt) {
      RequireUnit("direction of gravity", poses, 0, width - 7);
    }
    return single;
  }

  private static void RequireUnit(string name, double[][] poses, int first, int count) {
    for (int row = 0; row < poses.Length; row++) {
      double squared = 0;
      for (int i = first; i < first + count; i++) {
        squared += poses[row][i] * poses[row][i];
      }
      if (Math.Abs(Math.Sqrt(squared) - 1) > _unit) {
        throw new InputError($"pose {row}: found a {name} of length {Formats.General(Math.Sqrt(squared), 4)}, expected "
            + "unit length");
      }
    }
  }

  private static float[] Output(IReadOnlyDictionary<string, float[]> answers, string name, int width, int count) {
    if (!answers.TryGetValue(name, out var values) || values.Length != width * count) {
      throw new InputError($"network: found no {name} of shape ({count}, {width}) among its answers, expected one");
    }
    for (int i = 0; i < values.Length; i++) {
      if (float.IsNaN(values[i]) || float.IsInfinity(values[i])) {
        var row = new string[width];
        for (int column = 0; column < width; column++) {
          row[column] = Formats.General(values[i / width * width + column]);
        }
        throw new InputError($"pose {i / width}: found {name} [{string.Join(" ", row)}], expected finite numbers");
      }
    }
    return values;
  }

  private double[] Row(float[] values, int row) {
    var found = new double[_tendons];
    for (int i = 0; i < found.Length; i++) {
      found[i] = values[row * found.Length + i];
    }
    return found;
  }
}
}
