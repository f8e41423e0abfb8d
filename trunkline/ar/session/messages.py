"""What is rare, in JSON: every message of both directions, each with a `type`; what is not in here is refused.

Positions in m and quaternions (w, x, y, z), in the rigid base frame unless said otherwise; times in s.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError

from trunkline.ar.session.binary import VERSION
from trunkline.ar.teleop.messages import Mode, Motion, Offer, Pose, Targets, World
from trunkline.ar.teleop.plan import CorrectionBounds
from trunkline.errors import InputError, first_problem

STRICT = {"extra": "forbid", "ser_json_inf_nan": "null"}
LONGEST = 64  # characters of a name


def _text(value: Any) -> Any:
    """Text without what would spoil a line of the terminal."""
    return "".join(c for c in value if c.isprintable()) if isinstance(value, str) else value


Name = Annotated[str, BeforeValidator(_text), Field(max_length=LONGEST)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


# --- from the client


@dataclass(frozen=True)
class Hello:
    """First of all, within 3 s: the `version` of this protocol, and `token` or `code`, one of them.

    key: of the `welcome` before, to be the same client again; "" for a new one. space: "base" for poses in the rigid
    base frame, "room" for poses in a frame that stands still, y up, as WebXR's `local-floor`, which has to be aligned
    (`aligning`).
    """

    __pydantic_config__ = STRICT
    version: int
    token: Name = ""
    code: Name = ""
    key: Name = ""
    name: Name = ""
    space: Literal["base", "room"] = "base"
    type: Literal["hello"] = "hello"


@dataclass(frozen=True)
class Pong:
    """Answers a `ping` at once: its `number`, and the client's clock, `stamp`."""

    __pydantic_config__ = STRICT
    number: int
    stamp: Finite
    type: Literal["pong"] = "pong"


@dataclass(frozen=True)
class LeaseRequest:
    """Who controls: `ask` for it, `release` it, or `give` it `to` another client's id."""

    __pydantic_config__ = STRICT
    action: Literal["ask", "release", "give"]
    to: Name = ""
    type: Literal["lease"] = "lease"


@dataclass(frozen=True)
class AlignmentByEye:
    """Of a client in the "room": the base stands at `pose` of its reference frame as the user sees it, which is for a
    simulated robot alone. `pose` null: its reference frame has leapt, and where the base is is not known any more."""

    __pydantic_config__ = STRICT
    pose: Pose | None
    type: Literal["alignment"] = "alignment"


@dataclass(frozen=True)
class TouchRequest:
    """Of a client in the "room": align by touches, from the beginning. What is touched is seen in its `input`."""

    __pydantic_config__ = STRICT
    type: Literal["touch"] = "touch"


@dataclass(frozen=True)
class AnchorPose:
    """Of a client in the "room": its anchor `id` is at `pose` of its reference frame; null: it is lost, or that frame
    has leapt, and the robot holds until it is back."""

    __pydantic_config__ = STRICT
    id: Annotated[str, Field(max_length=LONGEST)]
    pose: Pose | None
    type: Literal["anchor"] = "anchor"


@dataclass(frozen=True)
class PreviewShown:
    """The preview of the plan `digest` has been shown to its end. Only of whom controls, and not sooner than the
    preview lasts."""

    __pydantic_config__ = STRICT
    digest: Annotated[str, Field(max_length=LONGEST)]
    type: Literal["shown"] = "shown"


ClientMessage = Hello | Pong | LeaseRequest | AlignmentByEye | TouchRequest | AnchorPose | PreviewShown


# --- from the server


@dataclass(frozen=True)
class Welcome:
    """Answers `hello`. id: by which all know the client. key: its secret, to be the same client again. token: for
    `GET /scene.json` (`Authorization: Bearer …`), and to come again. package: digest. rate: Hz, of frames of the
    robot."""

    id: str
    key: str
    token: str
    package: str
    rate: float
    version: int = VERSION
    type: Literal["welcome"] = "welcome"


@dataclass(frozen=True)
class Refusal:
    """One line: why what the client sent does nothing. `closing`: the connection ends."""

    reason: str
    closing: bool = False
    type: Literal["error"] = "error"


@dataclass(frozen=True)
class Ping:
    """To be answered by `pong` at once."""

    number: int
    type: Literal["ping"] = "ping"


@dataclass(frozen=True)
class Clock:
    """server = client + offset, s; of the smallest of the last ten `round_trip`s, s. Input counts from the first on,
    where neither it is more than 0.25 s late nor that `round_trip` longer."""

    offset: float
    round_trip: float
    type: Literal["clock"] = "clock"


@dataclass(frozen=True)
class Person:
    """A client."""

    id: str
    name: str


@dataclass(frozen=True)
class Lease:
    """Who controls: `holder`'s id, "" for nobody; who is `asking`, in their order; all `clients`."""

    holder: str
    asking: tuple[str, ...] = ()
    clients: tuple[Person, ...] = ()
    type: Literal["lease"] = "lease"


AligningStep = Literal["place", "tip", "touch", "check", "lost", "done"]


@dataclass(frozen=True)
class AlignmentProgress:
    """To a client in the "room", how far its alignment is: the `step`, what is to be done `next` and what was `said` of
    the last, in words.

    place: pose of the base in the client's reference frame, null where it is not known yet. expected: error of it where
    the arm works, or of the one touch, m; residual: of the touches, rms, m; null where nothing tells. anchor: id of the
    one to be restored, or that is followed; "" for none. fasten: an anchor shall be fastened at `place`, and told.
    """

    step: AligningStep
    next: str
    said: str
    place: Pose | None
    expected: float | None
    residual: float | None
    anchor: str
    fasten: bool
    type: Literal["aligning"] = "aligning"


@dataclass(frozen=True)
class StateMessage:
    """What the core wants and the robot does; sent when it changes, at most ten times a second but for its `mode`.

    notice: one line for the user, "" for none. next: the one next action in words, for whom controls; keys: the same at
    mouse and keyboard. countdown: s to the execution, when this was sent. preview, execute: digests. targets: as the
    core has them; where they are now, the markers of the robot's frames say. robot: what it does; fault: in words.
    correction: the one that goes on, or how the last ended, in words.
    """

    mode: Mode
    motion: Motion
    notice: str
    next: str
    keys: str
    countdown: float
    preview: str
    execute: str
    targets: Targets | None
    robot: Literal["idle", "running", "done", "fault"]
    fault: str
    correction: str = ""
    type: Literal["state"] = "state"


Point = tuple[float, float, float]


@dataclass(frozen=True)
class MeasuredMessage:
    """The arm as cameras see it, ten times a second where a session has any. markers: m, from the mount to the tip,
    null where one is not seen; tip: m. apart: from there to the drawn robot's tip, m; null where it is not seen. age:
    s; rate: Hz; loss: share of the frames that did not come. fault: why nothing is corrected by them now, ""
    while they are sound. from_preview: from the tip to where the preview of the plan that ran last had it at its end,
    m, and radius: that the preview stated about there, m; both null until it has arrived, and where it stated none or
    corrected itself. frame: by what the cameras' frame in the base is known, in words."""

    markers: tuple[Point | None, ...]
    tip: Point | None
    apart: float | None
    age: float
    rate: float
    loss: float
    fault: str
    from_preview: float | None = None
    radius: float | None = None
    frame: str = ""
    type: Literal["measured"] = "measured"


@dataclass(frozen=True)
class PreviewMessage:
    """A plan is there: its `digest`, and the preview that follows in binary pieces: `step` s between frames, `duration`
    s in all, which a client shows at that pace. begins: s of the plan at the first frame. phases: name and s of the
    plan. correction: by how much it may correct itself by what cameras see, once it has arrived, which the digest
    covers; null where it may not, and `uncorrected` says why, where it was asked to. target: of the tip, m. steps: at
    most. longest: m, change of all commands together in a step; `steps` times that in all. astray: m from the target,
    beyond which the tip ends it."""

    digest: str
    step: float
    duration: float
    begins: float
    phases: tuple[tuple[str, float], ...]
    correction: CorrectionBounds | None = None
    uncorrected: str = ""
    type: Literal["preview"] = "preview"


@dataclass(frozen=True)
class PredictionMessage:
    """What the batch of futures says of the plan `digest`, once they are simulated.

    probability: that the grasp holds, with its interval `low` to `high`; null where nothing is grasped. times: s of the
    preview, at which `tip` is where its tip is, and `spread` the distance from it within which the robot's is with
    probability `within`, m; empty where that is unknown, and `unknown` says why. miss: from the tip at the preview's
    end to its target, m; null where an object is the target. offer: the assistant's. futures: how many.
    """

    digest: str
    probability: float | None
    low: float | None
    high: float | None
    times: tuple[float, ...]
    tip: tuple[tuple[float, float, float], ...]
    spread: tuple[float, ...]
    within: float
    futures: int
    miss: float | None = None
    unknown: str = ""
    offer: Offer | None = None
    type: Literal["foreseen"] = "foreseen"


@dataclass(frozen=True)
class WorldMessage:
    """The world as it is believed: obstacles and objects."""

    world: World
    type: Literal["world"] = "world"


ServerMessage = (
    Welcome
    | Refusal
    | Ping
    | Clock
    | Lease
    | AlignmentProgress
    | StateMessage
    | PreviewMessage
    | PredictionMessage
    | MeasuredMessage
    | WorldMessage
)

CLIENT_MESSAGES: tuple[type, ...] = get_args(ClientMessage)
SERVER_MESSAGES: tuple[type, ...] = get_args(ServerMessage)

_CLIENT_MESSAGE: TypeAdapter[ClientMessage] = TypeAdapter(Annotated[ClientMessage, Field(discriminator="type")])
_SERVER_MESSAGES: dict[type, TypeAdapter[Any]] = {kind: TypeAdapter(kind) for kind in SERVER_MESSAGES}


def hear(text: str) -> ClientMessage:
    """A client's message.

    Raises:
        InputError: it is none.
    """
    try:
        return _CLIENT_MESSAGE.validate_json(text)
    except ValidationError as error:
        raise InputError(f"message: {first_problem(error)}") from error
    except (RecursionError, UnicodeError) as error:
        raise InputError("message: found what is no JSON") from error


def tell(answer: ServerMessage) -> str:
    """One line of JSON; what is no number is null."""
    return _SERVER_MESSAGES[type(answer)].dump_json(answer).decode()
