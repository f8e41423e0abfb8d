"""What goes into the core and what comes out, and both as JSON: the vectors that clients in other languages share.

Frames: `reference` is the headset's, any frame that stands still; `base` is the rigid robot's, z up. A controller's
pose is the pose of its ray: origin at the device, the ray along -z, y up from the back of the hand (WebXR's target ray
space). Positions in m, quaternions (w, x, y, z), stamps in s of the client's clock. In JSON, which clients in other
languages read, some fields have another name: their `alias`.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, TypeVar

from pydantic import BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationError

from trunkline.ar.hybrid.basket import Basket
from trunkline.errors import InputError, first_problem

STRICT = ConfigDict(extra="forbid", ser_json_inf_nan="null", serialize_by_alias=True)
# JSON has no NaN: it is written as null, and read back, so that recorded faults are vectors too.
Number = Annotated[float, BeforeValidator(lambda value: float("nan") if value is None else value)]
Vector = tuple[Number, Number, Number]
Quaternion = tuple[Number, Number, Number, Number]
Joints = tuple[Number, Number, Number, Number, Number, Number, Number]
Message = TypeVar("Message", "Input", "Intent")

Mode = Literal["hold", "aim", "plan", "preview", "ready", "delay", "execute", "follow", "stopped"]
Motion = Literal["hold", "execute", "follow"]


@dataclass(frozen=True)
class Controller:
    """One tracked controller: its pose in the reference frame, `stick` (x right, y forward, -1 to 1) and what is
    held."""

    __pydantic_config__ = STRICT
    position: Vector
    quaternion: Quaternion
    tracked: bool = True
    trigger: bool = False
    grip: bool = False
    stick: tuple[Number, Number] = (0.0, 0.0)
    stick_pressed: bool = False
    primary: bool = False
    secondary: bool = False


@dataclass(frozen=True)
class Pose:
    """Of the reference frame in the base frame: p_base = position + rotate(quaternion, p_reference)."""

    __pydantic_config__ = STRICT
    position: Vector
    quaternion: Quaternion


@dataclass(frozen=True)
class Obstacle:
    """A solid that must not be touched, axes along the base frame: `low` and `high` corners, m. A table, a seat,
    the floor."""

    __pydantic_config__ = STRICT
    name: str
    low: Vector
    high: Vector


@dataclass(frozen=True)
class WorldObject:
    """Something to grasp, as the client believes it: `position` of its centre, m, and `quaternion`, in the base frame.

    `diameter`: m, of a box its width along x and y, of a basket its bar's; `height`: m, along z, idle for a sphere, of
    a basket its box's; `mass`: kg. `support`: what holds it: a hook, a surface, or the arm. `basket`: a basket's other
    sizes, idle for other shapes.
    """

    __pydantic_config__ = STRICT
    name: str
    shape: Literal["cylinder", "box", "sphere", "toy", "basket"]
    diameter: Number
    height: Number
    mass: Number
    position: Vector
    quaternion: Quaternion = (1.0, 0.0, 0.0, 0.0)
    support: Literal["hanging", "standing", "held"] = "hanging"
    basket: Basket = Basket()


@dataclass(frozen=True)
class World:
    """What stands around the robot: its `digest`, which changes with it, the obstacles, and the objects that can be
    grasped."""

    __pydantic_config__ = STRICT
    digest: str
    obstacles: Annotated[tuple[Obstacle, ...], Field(alias="boxes")] = ()
    objects: Annotated[tuple[WorldObject, ...], Field(alias="things")] = ()

    def object(self, name: str) -> WorldObject:
        """That of this name; there is one, as names come from here."""
        return next(object for object in self.objects if object.name == name)

    @property
    def held_object(self) -> WorldObject | None:
        """What the arm holds."""
        return next((object for object in self.objects if object.support == "held"), None)


@dataclass(frozen=True)
class Offer:
    """The assistant's: with the mount at `rigid`, m, the end effector `pointing`, the object is held with
    `probability`, more surely than where the user has it."""

    __pydantic_config__ = STRICT
    object: Annotated[str, Field(alias="thing")]
    rigid: Vector
    pointing: Vector
    probability: Number


@dataclass(frozen=True)
class PlanReport:
    """What became of plan request `serial`: its `digest`, or why it was refused; the package and world it was made
    for."""

    __pydantic_config__ = STRICT
    serial: int
    digest: str = ""
    refused: str = ""
    package: str = ""
    world: str = ""


@dataclass(frozen=True)
class ExecutorReport:
    """What the robot does: `fault` in words where it has one, `digest` of the plan that it runs or has run."""

    __pydantic_config__ = STRICT
    mode: Literal["idle", "running", "done", "fault"] = "idle"
    digest: str = ""
    fault: str = ""


@dataclass(frozen=True)
class Input:
    """All that the core hears at one step.

    `joints`: of the rigid robot, rad. `alignment`: None until the base is aligned. `package`: digest of the package in
    use. `plan`: the newest report. `shown`: digest of the plan whose preview has been shown to its end. `offer`: a
    place of the mount that the assistant has found better than that of the newest plan.
    """

    __pydantic_config__ = STRICT
    stamp: Number
    left: Controller
    right: Controller
    alignment: Pose | None
    joints: Joints
    world: World
    package: str
    plan: PlanReport | None = None
    shown: str = ""
    executor: ExecutorReport = ExecutorReport()
    offer: Offer | None = None


@dataclass(frozen=True)
class Target:
    """A target in the base frame, and whether it can be reached.

    `reach`: "inside", "outside", "unknown" (no map tells), "blocked" (in an obstacle, named by `obstacle`).
    `offer`: where outside, the nearest point that is inside; an offer only, the target stays where the user put it.
    """

    __pydantic_config__ = STRICT
    position: Vector
    reach: Literal["inside", "outside", "unknown", "blocked"] = "unknown"
    outside_by: Number = 0.0
    offer: Vector | None = None
    obstacle: Annotated[str, Field(alias="solid")] = ""


@dataclass(frozen=True)
class Targets:
    """Rigid target (the mount) and soft tip target, and how the mount shall be turned.

    `pointing`: direction in which the end effector points, unit length; `heading`: angle of the soft arm's tendon 1
    about the arm's axis, rad (`alignment.base_quaternion`). `half_plane`: which bends, 0 dorsal, 1 ventral. `turned`:
    by which the wrist turns from where it is, rad; None where no half-plane is within the wrist's limits.
    `tilt_limited`: the controller was tilted further than the end effector may be. `object`: name of what the tip
    target marks, to be grasped, or of what the arm holds, to be brought to where the tip target is then; "" for
    nothing. `better`: the assistant's offer; an offer only.
    """

    __pydantic_config__ = STRICT
    rigid: Target
    tip: Target
    pointing: Vector
    heading: Number
    half_plane: int
    turned: Number | None
    tilt_limited: bool = False
    object: Annotated[str, Field(alias="thing")] = ""
    better: Offer | None = None


@dataclass(frozen=True)
class Request:
    """A plan that the core asks for: answered by a `PlanReport` of the same `serial`."""

    __pydantic_config__ = STRICT
    serial: int
    targets: Targets
    world: str
    package: str


@dataclass(frozen=True)
class Intent:
    """What the core wants at one step.

    `motion`: the only thing that lets the robot move: "hold" stops it. `execute`: digest to run, with motion "execute".
    `follow`: where the robot shall be now, with motion "follow". `rays`: end of the left and of the right ray, base
    frame. `countdown`: s until execution begins. `notice`: one line for the user, "" for none.
    """

    __pydantic_config__ = STRICT
    mode: Mode
    motion: Motion
    notice: str
    targets: Targets | None
    rays: tuple[Vector | None, Vector | None]
    request: Request | None = None
    preview: str = ""
    execute: str = ""
    countdown: Number = 0.0
    follow: Targets | None = None


_ADAPTERS: dict[type, TypeAdapter] = {kind: TypeAdapter(kind) for kind in (Input, Intent)}


def to_json(message: Input | Intent) -> bytes:
    """One line, the same bytes for the same message; numbers read back exactly."""
    return _ADAPTERS[type(message)].dump_json(message)


def from_json(kind: type[Message], text: str | bytes) -> Message:
    """The message that `to_json` wrote.

    Raises:
        InputError: it is none of this kind.
    """
    try:
        return _ADAPTERS[kind].validate_json(text)
    except ValidationError as error:
        raise InputError(f"{kind.__name__}: {first_problem(error)}") from error
