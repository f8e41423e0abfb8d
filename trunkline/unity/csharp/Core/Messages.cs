using System.Collections.Generic;

namespace Trunkline {

// What goes into the core and what comes out: trunkline/ar/teleop/messages.py.
//
// Frames: `reference` is the headset's, right-handed, any that stands still; `base` is the rigid robot's, z up. A
// controller's pose is that of its ray: origin at the device, the ray along -z, y up from the back of the hand.
// Positions in m, quaternions (w, x, y, z), stamps in s of the client's clock. `Frames` converts from Unity's.

/// <summary>What the session is at.</summary>
public enum Mode {
  /// <summary>The robot stands still until all is sound.</summary>
  Hold,
  /// <summary>The user sets targets.</summary>
  Aim,
  /// <summary>A plan is awaited.</summary>
  Plan,
  /// <summary>It is being shown.</summary>
  Preview,
  /// <summary>It was shown and can be confirmed.</summary>
  Ready,
  /// <summary>It was confirmed and begins soon.</summary>
  Delay,
  /// <summary>The robot runs it.</summary>
  Execute,
  /// <summary>The robot follows the targets.</summary>
  Follow,
  /// <summary>The robot stands still until a primary button goes down.</summary>
  Stopped,
}

/// <summary>What the robot may do now.</summary>
public enum Motion {
  /// <summary>Stand still.</summary>
  Hold,
  /// <summary>Run the plan.</summary>
  Execute,
  /// <summary>Follow the targets.</summary>
  Follow,
}

/// <summary>Where a point is.</summary>
public enum Where {
  /// <summary>Within reach.</summary>
  Inside,
  /// <summary>Out of reach.</summary>
  Outside,
  /// <summary>No map tells.</summary>
  Unknown,
  /// <summary>In a solid of the world.</summary>
  Blocked,
}

/// <summary>Of a thing.</summary>
public enum Shape {
  /// <summary>Its axis is z.</summary>
  Cylinder,
  /// <summary>As wide along x as along y.</summary>
  Box,
  /// <summary>Of one diameter.</summary>
  Sphere,
  /// <summary>A soft box with round edges.</summary>
  Toy,
  /// <summary>A box with a bar above it, which the arm grips.</summary>
  Basket,
}

/// <summary>What bears a thing.</summary>
public enum Support {
  /// <summary>A hook.</summary>
  Hanging,
  /// <summary>A surface.</summary>
  Standing,
  /// <summary>The arm.</summary>
  Held,
}

/// <summary>What the robot does with the plan whose digest its report has.</summary>
public enum ExecutorMode {
  /// <summary>Nothing: it has none.</summary>
  Idle,
  /// <summary>Runs it.</summary>
  Running,
  /// <summary>Has run it to its end.</summary>
  Done,
  /// <summary>Stands still; its report says why.</summary>
  Fault,
}

/// <summary>One tracked controller: its pose in the reference frame, its stick and what is held.</summary>
public sealed class Controller {
  /// <summary>Where the ray begins, reference frame, m.</summary>
  public readonly Vector Position;
  /// <summary>Unit length, from the controller's axes (ray along -z, y up) to the reference frame's.</summary>
  public readonly Quaternion Quaternion;
  /// <summary>Whether its pose is measured now; where it is not, pose and buttons count for nothing, but for
  /// <see cref="Secondary"/>.</summary>
  public readonly bool Tracked;
  /// <summary>Held now, as all buttons below: a press is what goes down from one input to the next. It asks for a plan
  /// and confirms it.</summary>
  public readonly bool Trigger;
  /// <summary>Moves its hand's target, and lets the robot move.</summary>
  public readonly bool Grip;
  /// <summary>Begins and ends following.</summary>
  public readonly bool StickPressed;
  /// <summary>A or X: takes an offer, with the grip tilts the end effector, and ends a stop.</summary>
  public readonly bool Primary;
  /// <summary>B or Y: stops.</summary>
  public readonly bool Secondary;
  /// <summary>-1 to 1, to the right.</summary>
  public readonly double StickX;
  /// <summary>-1 to 1, forward, which lengthens the ray.</summary>
  public readonly double StickY;

  /// <summary>As the fields of the same names.</summary>
  public Controller(Vector position, Quaternion quaternion, bool tracked = true, bool trigger = false,
                    bool grip = false, double stickX = 0, double stickY = 0, bool stickPressed = false,
                    bool primary = false, bool secondary = false) {
    Position = position;
    Quaternion = quaternion;
    Tracked = tracked;
    Trigger = trigger;
    Grip = grip;
    StickX = stickX;
    StickY = stickY;
    StickPressed = stickPressed;
    Primary = primary;
    Secondary = secondary;
  }
}

/// <summary>Of the reference frame in the base frame: p_base = position + rotate(quaternion, p_reference); m.</summary>
public sealed class Pose {
  /// <summary>Of the reference frame's origin, base frame, m.</summary>
  public readonly Vector Position;
  /// <summary>Unit length, from the reference frame's axes to the base frame's.</summary>
  public readonly Quaternion Quaternion;

  /// <summary>As the fields of the same names.</summary>
  public Pose(Vector position, Quaternion quaternion) {
    Position = position;
    Quaternion = quaternion;
  }

  internal static bool Same(Pose a, Pose b) =>
      ReferenceEquals(a, b) || (a != null && b != null && a.Position == b.Position && a.Quaternion == b.Quaternion);
}

/// <summary>A solid, axes along the base frame: corners, m. A table, a chair's seat, the floor.</summary>
public sealed class Box {
  /// <summary>As the user reads it where a target is in it.</summary>
  public readonly string Name;
  /// <summary>Corner, base frame, m: none of its coordinates is above High's.</summary>
  public readonly Vector Low;
  /// <summary>The opposite corner, base frame, m.</summary>
  public readonly Vector High;

  /// <summary>As the fields of the same names.</summary>
  public Box(string name, Vector low, Vector high) {
    Name = name;
    Low = low;
    High = high;
  }

  internal bool Has(Vector place) =>
      Low.X <= place.X && place.X <= High.X && Low.Y <= place.Y && place.Y <= High.Y && Low.Z <= place.Z
      && place.Z <= High.Z;

  internal bool IsAs(Box other) => Name == other.Name && Low == other.Low && High == other.High;
}

/// <summary>Sizes of a basket, m: its box's width along x and length along y, and the rise of the bar above
/// it.</summary>
public readonly struct Basket {
  /// <summary>Of its box along x, m.</summary>
  public readonly double Width;
  /// <summary>Of its box along y, m.</summary>
  public readonly double Length;
  /// <summary>Of the bar above the box, m.</summary>
  public readonly double Rise;

  /// <summary>As the fields of the same names.</summary>
  public Basket(double width, double length, double rise) {
    Width = width;
    Length = length;
    Rise = rise;
  }

  /// <summary>That of the demo: 0.12, 0.16 and 0.22 m. Things of other shapes may have it too.</summary>
  public static Basket Usual => new Basket(0.12, 0.16, 0.22);

  internal bool IsAs(Basket other) => Width == other.Width && Length == other.Length && Rise == other.Rise;
}

/// <summary>Something to grasp, as the client believes it: position of its centre, m, and quaternion, in the base
/// frame.</summary>
public sealed class Thing {
  /// <summary>Of no other thing of the world.</summary>
  public readonly string Name;
  /// <summary>Which sizes count, and how it is grasped.</summary>
  public readonly Shape Shape;
  /// <summary>m, of a box its width along x and y, of a basket its bar's.</summary>
  public readonly double Diameter;
  /// <summary>m, along z, of a basket its box's.</summary>
  public readonly double Height;
  /// <summary>kg.</summary>
  public readonly double Mass;
  /// <summary>Of its centre (of mass, of a basket), base frame, m.</summary>
  public readonly Vector Position;
  /// <summary>Unit length, from its own axes to the base frame's.</summary>
  public readonly Quaternion Quaternion;
  /// <summary>What bears it.</summary>
  public readonly Support Support;
  /// <summary>Counts where <see cref="Shape"/> is a basket.</summary>
  public readonly Basket Basket;

  /// <summary>As the fields of the same names: m, kg, base frame.</summary>
  public Thing(string name, Shape shape, double diameter, double height, double mass, Vector position,
               Quaternion quaternion, Support support, Basket basket) {
    Name = name;
    Shape = shape;
    Diameter = diameter;
    Height = height;
    Mass = mass;
    Position = position;
    Quaternion = quaternion;
    Support = support;
    Basket = basket;
  }

  internal bool IsAs(Thing other) =>
      Name == other.Name && Shape == other.Shape && Diameter == other.Diameter && Height == other.Height
      && Mass == other.Mass && Position == other.Position && Quaternion == other.Quaternion && Support == other.Support
      && Basket.IsAs(other.Basket);
}

/// <summary>What stands around the robot: a digest, which changes with it, the solids that no target may be in, and the
/// things that can be grasped.</summary>
public sealed class World {
  /// <summary>Any text that differs whenever boxes or things do. A plan is void in a world of another.</summary>
  public readonly string Digest;
  /// <summary>Solids that no target may be in; never null.</summary>
  public readonly IReadOnlyList<Box> Boxes;
  /// <summary>What can be grasped; never null.</summary>
  public readonly IReadOnlyList<Thing> Things;

  /// <summary>As the fields of the same names; null for no boxes or things.</summary>
  public World(string digest, IReadOnlyList<Box> boxes = null, IReadOnlyList<Thing> things = null) {
    Digest = digest;
    Boxes = boxes ?? new Box[0];
    Things = things ?? new Thing[0];
  }

  /// <summary>What the arm holds; null where it holds nothing.</summary>
  public Thing Held {
    get {
      foreach (var thing in Things) {
        if (thing.Support == Support.Held) {
          return thing;
        }
      }
      return null;
    }
  }

  internal bool IsAs(World other) {
    if (ReferenceEquals(this, other)) {
      return true;
    }
    if (Digest != other.Digest || Boxes.Count != other.Boxes.Count || Things.Count != other.Things.Count) {
      return false;
    }
    for (int i = 0; i < Boxes.Count; i++) {
      if (!Boxes[i].IsAs(other.Boxes[i])) {
        return false;
      }
    }
    for (int i = 0; i < Things.Count; i++) {
      if (!Things[i].IsAs(other.Things[i])) {
        return false;
      }
    }
    return true;
  }
}

/// <summary>The assistant's: with the mount at <see cref="Rigid"/>, the end effector pointing along
/// <see cref="Pointing"/>, the thing is held with a probability, more surely than where the user has it.</summary>
public sealed class Offer {
  /// <summary>Its name in the world.</summary>
  public readonly string Thing;
  /// <summary>Of the mount, base frame, m.</summary>
  public readonly Vector Rigid;
  /// <summary>Direction, base frame, unit length.</summary>
  public readonly Vector Pointing;
  /// <summary>0 to 1.</summary>
  public readonly double Probability;

  /// <summary>As the fields of the same names.</summary>
  public Offer(string thing, Vector rigid, Vector pointing, double probability) {
    Thing = thing;
    Rigid = rigid;
    Pointing = pointing;
    Probability = probability;
  }
}

/// <summary>What became of plan request <see cref="Serial"/>: its digest, or why it was refused; the package and world
/// it was made for.</summary>
public sealed class PlanReport {
  /// <summary>That of the <see cref="Request"/> that it answers.</summary>
  public readonly int Serial;
  /// <summary>Of the plan, any text that no other plan has; "" where it was refused.</summary>
  public readonly string Digest;
  /// <summary>Why there is no plan, one line; "" where there is one.</summary>
  public readonly string Refused;
  /// <summary>Its digest, as the request had it; a plan for another is refused.</summary>
  public readonly string Package;
  /// <summary>Its digest, as the request had it; a plan for another is refused.</summary>
  public readonly string World;

  /// <summary>As the fields of the same names.</summary>
  public PlanReport(int serial, string digest = "", string refused = "", string package = "", string world = "") {
    Serial = serial;
    Digest = digest;
    Refused = refused;
    Package = package;
    World = world;
  }
}

/// <summary>What the robot does: <see cref="Fault"/> in words where it has one, digest of the plan that it runs or has
/// run.</summary>
public sealed class ExecutorReport {
  /// <summary>What it does now.</summary>
  public readonly ExecutorMode Mode;
  /// <summary>Of the plan that it runs or has run; "" for none.</summary>
  public readonly string Digest;
  /// <summary>One line; counts where <see cref="Mode"/> is a fault.</summary>
  public readonly string Fault;

  /// <summary>As the fields of the same names.</summary>
  public ExecutorReport(ExecutorMode mode = ExecutorMode.Idle, string digest = "", string fault = "") {
    Mode = mode;
    Digest = digest;
    Fault = fault;
  }
}

/// <summary>All that the core hears at one step.</summary>
public sealed class Input {
  /// <summary>s, of the client's clock.</summary>
  public readonly double Stamp;
  /// <summary>Never null: a controller that is not there is one that is not tracked.</summary>
  public readonly Controller Left;
  /// <summary>Never null either.</summary>
  public readonly Controller Right;
  /// <summary>Null until the base is aligned.</summary>
  public readonly Pose Alignment;
  /// <summary>Of the rigid robot, rad, seven.</summary>
  public readonly IReadOnlyList<double> Joints;
  /// <summary>What stands around the robot.</summary>
  public readonly World World;
  /// <summary>Digest of the package in use.</summary>
  public readonly string Package;
  /// <summary>The newest report; null where there is none.</summary>
  public readonly PlanReport Plan;
  /// <summary>Digest of the plan whose preview has been shown to its end; "" for none.</summary>
  public readonly string Shown;
  /// <summary>What the robot does now.</summary>
  public readonly ExecutorReport Executor;
  /// <summary>A place of the mount that the assistant has found better than that of the newest plan, or null.</summary>
  public readonly Offer Offer;

  /// <summary>As the fields of the same names; null for an executor that is idle.</summary>
  public Input(double stamp, Controller left, Controller right, Pose alignment, IReadOnlyList<double> joints,
               World world, string package, PlanReport plan = null, string shown = "",
               ExecutorReport executor = null, Offer offer = null) {
    Stamp = stamp;
    Left = left;
    Right = right;
    Alignment = alignment;
    Joints = joints;
    World = world;
    Package = package;
    Plan = plan;
    Shown = shown;
    Executor = executor ?? new ExecutorReport();
    Offer = offer;
  }
}

/// <summary>A target in the base frame, and whether it can be reached.</summary>
public sealed class Target {
  /// <summary>Base frame, m.</summary>
  public readonly Vector Position;
  /// <summary>Whether it is within reach, and in no solid.</summary>
  public readonly Where Reach;
  /// <summary>How far it is from the nearest place within reach, m; 0 unless outside.</summary>
  public readonly double OutsideBy;
  /// <summary>Where outside, the nearest point that is inside, base frame, m, or null; the target stays where the user
  /// put it.</summary>
  public readonly Vector? Offer;
  /// <summary>Name of the solid that it is in, "" for none.</summary>
  public readonly string Solid;

  /// <summary>As the fields of the same names.</summary>
  public Target(Vector position, Where reach = Where.Unknown, double outsideBy = 0, Vector? offer = null,
                string solid = "") {
    Position = position;
    Reach = reach;
    OutsideBy = outsideBy;
    Offer = offer;
    Solid = solid;
  }
}

/// <summary>Rigid target (the mount) and soft tip target, and how the mount shall be turned.</summary>
public sealed class Targets {
  /// <summary>Of the mount.</summary>
  public readonly Target Rigid;
  /// <summary>Of the soft arm's tip.</summary>
  public readonly Target Tip;
  /// <summary>Direction in which the end effector points, base frame, unit length.</summary>
  public readonly Vector Pointing;
  /// <summary>Angle of the soft arm's tendon 1 about the arm's axis, rad (<see cref="Alignment"/>).</summary>
  public readonly double Heading;
  /// <summary>In which the arm bends: its number in <see cref="BendingPlane.HalfPlanes"/>, 0 dorsal, 1
  /// ventral.</summary>
  public readonly int HalfPlane;
  /// <summary>By which the wrist turns from where it is, rad; null where no half-plane is within its limits.</summary>
  public readonly double? Turned;
  /// <summary>The controller was tilted further than the end effector may be.</summary>
  public readonly bool TiltLimited;
  /// <summary>Name of what the tip target marks, or of what the arm holds; "" for nothing.</summary>
  public readonly string Thing;
  /// <summary>The assistant's offer, or null.</summary>
  public readonly Offer Better;

  /// <summary>As the fields of the same names.</summary>
  public Targets(Target rigid, Target tip, Vector pointing, double heading, int halfPlane, double? turned,
                 bool tiltLimited = false, string thing = "", Offer better = null) {
    Rigid = rigid;
    Tip = tip;
    Pointing = pointing;
    Heading = heading;
    HalfPlane = halfPlane;
    Turned = turned;
    TiltLimited = tiltLimited;
    Thing = thing;
    Better = better;
  }

  internal Targets WithBetter(Offer better) =>
      new Targets(Rigid, Tip, Pointing, Heading, HalfPlane, Turned, TiltLimited, Thing, better);
}

/// <summary>A plan that the core asks for: answered by a <see cref="PlanReport"/> of the same serial.</summary>
public sealed class Request {
  /// <summary>From 1 on, one more at each request.</summary>
  public readonly int Serial;
  /// <summary>Where the plan shall lead.</summary>
  public readonly Targets Targets;
  /// <summary>Digest of the world that the plan shall be for.</summary>
  public readonly string World;
  /// <summary>Digest of the package that the plan shall be for.</summary>
  public readonly string Package;

  /// <summary>As the fields of the same names.</summary>
  public Request(int serial, Targets targets, string world, string package) {
    Serial = serial;
    Targets = targets;
    World = world;
    Package = package;
  }
}

/// <summary>What the core wants at one step.</summary>
public sealed class Intent {
  /// <summary>What the session is at.</summary>
  public readonly Mode Mode;
  /// <summary>The only thing that lets the robot move: <see cref="Motion.Hold"/> stops it.</summary>
  public readonly Motion Motion;
  /// <summary>One line for the user, "" for none.</summary>
  public readonly string Notice;
  /// <summary>Null where one of both is not set.</summary>
  public readonly Targets Targets;
  /// <summary>End of the left hand's ray, base frame, m, or null.</summary>
  public readonly Vector? LeftRay;
  /// <summary>End of the right hand's ray, base frame, m, or null.</summary>
  public readonly Vector? RightRay;
  /// <summary>Null but in the mode plan.</summary>
  public readonly Request Request;
  /// <summary>Digest of the plan to show, "" for none.</summary>
  public readonly string Preview;
  /// <summary>Digest of the plan to run, with motion <see cref="Motion.Execute"/>, else "".</summary>
  public readonly string Execute;
  /// <summary>s until execution begins; 0 but in the mode delay.</summary>
  public readonly double Countdown;
  /// <summary>Where the robot shall be now, with motion <see cref="Motion.Follow"/>, else null.</summary>
  public readonly Targets Follow;

  /// <summary>As the fields of the same names.</summary>
  public Intent(Mode mode, Motion motion, string notice, Targets targets, Vector? leftRay, Vector? rightRay,
                Request request, string preview, string execute, double countdown, Targets follow) {
    Mode = mode;
    Motion = motion;
    Notice = notice;
    Targets = targets;
    LeftRay = leftRay;
    RightRay = rightRay;
    Request = request;
    Preview = preview;
    Execute = execute;
    Countdown = countdown;
    Follow = follow;
  }

  internal Intent WithNotice(string notice) => new Intent(
      Mode, Motion, notice, Targets, LeftRay, RightRay, Request, Preview, Execute, Countdown, Follow);
}
}
