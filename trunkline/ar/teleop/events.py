"""What happened at a step, of all that the state machine answers to, and a line about what was asked for in vain."""

from trunkline.ar.teleop.messages import Input, Targets, Vector
from trunkline.ar.teleop.settings import Teleop
from trunkline.ar.teleop.state import TeleoperationState
from trunkline.ar.teleop.targets import why_not
from trunkline.ar.teleop.transitions import Event, first_event
from trunkline.ar.teleop.vectors import distance

Ends = tuple[Vector | None, Vector | None]


def stopped_by(message: Input) -> bool:
    """Whether either secondary button is held; it counts even where nothing else of an input does."""
    return message.left.secondary or message.right.secondary


def detect_events(
    state: TeleoperationState, message: Input, targets: Targets | None, ends: Ends, settings: Teleop
) -> tuple[dict[Event, bool], str]:
    """Of a sound step; `targets` are the present ones, `ends` those of the rays."""
    pressed, notice = state.pressed, ""
    if state.mode == "aim" and "trigger" in pressed:
        notice = why_not(looked_back(state, settings))
    elif state.mode == "aim" and "stick_pressed" in pressed:
        notice = why_not(targets) or ("" if state.gripped else "hold a grip to follow")
    changed, refused, fault = changed_since(state, message, ends, settings), refusal(state, message, settings), ""
    if message.executor.mode == "fault":
        fault = message.executor.fault or "no reason given"
    elif state.mode == "execute" and not state.running and state.waited > settings.safety.start_wait:
        fault = f"did not start within {settings.safety.start_wait:g} s"
    arrived = message.executor.mode == "done" and message.executor.digest == state.digest
    events: dict[Event, bool] = {
        "stop": stopped_by(message),
        "fault": bool(fault),
        "void": bool(changed),
        "released": not state.gripped,
        "refused": bool(refused),
        "settled": state.idle and state.sound_for >= settings.safety.settle,
        "reset": "primary" in pressed,
        "ask": "trigger" in pressed and not notice,
        "planned": answered(state, message) and not refused,
        "shown": bool(state.digest) and message.shown == state.digest,
        "confirm": "trigger" in pressed and state.gripped,
        "elapsed": state.waited >= settings.delay,
        "done": state.running and arrived,
        "follow": "stick_pressed" in pressed and not notice,
        "unfollow": "stick_pressed" in pressed,
    }
    lines: dict[Event | None, str] = {
        "fault": f"robot: {fault}; stopped",
        "void": f"{changed}; the plan is void",
        "refused": refused,
        "released": "grips let go; holding",
        "stop": "stopped; primary button goes on",
    }
    return events, lines.get(first_event(state.mode, events), notice)


def looked_back(state: TeleoperationState, settings: Teleop) -> Targets | None:
    """The targets before the trigger's jerk; the oldest there are where none is old enough."""
    return state.before(settings.look_back) or (state.history[0][1] if state.history else None)


def answered(state: TeleoperationState, message: Input) -> bool:
    """Whether the plan that was asked for is there, or its refusal."""
    return message.plan is not None and state.pinned is not None and message.plan.serial == state.pinned.request.serial


def refusal(state: TeleoperationState, message: Input, settings: Teleop) -> str:
    """Why there is no plan, "" where there is one or still may be."""
    if answered(state, message):
        assert message.plan is not None
        assert state.pinned is not None
        report, request = message.plan, state.pinned.request
        if report.refused:
            return f"no plan: {report.refused}"
        if (report.package, report.world) != (request.package, request.world):
            return "no plan: it was made for another package or world"
        return "" if report.digest else "no plan: it has no digest"
    late = state.mode == "plan" and state.waited > settings.safety.plan_wait
    return f"no plan within {settings.safety.plan_wait:g} s" if late else ""


def takes_offer(state: TeleoperationState, message: Input, settings: Teleop) -> bool:
    """Whether the assistant's offer for the plan that is shown is taken: the rigid hand's primary, its grip let go."""
    hand, pinned = state.hands[("left", "right").index(settings.rigid_hand)], state.pinned
    mine = pinned is not None and message.offer is not None and message.offer.object == pinned.request.targets.object
    return mine and "primary" in hand.pressed and not hand.grips


def changed_since(state: TeleoperationState, message: Input, ends: Ends, settings: Teleop) -> str:
    """What has changed of that for which the plan was made, "" where nothing has."""
    pinned = state.pinned
    if pinned is None:
        return ""
    if message.world != pinned.world:
        return "world changed"
    if message.alignment != pinned.alignment:
        return "base alignment changed"
    if state.mode in ("preview", "ready") and takes_offer(state, message, settings):
        return "the offer was taken"
    if state.mode in ("ready", "delay") and message.shown != state.digest:
        return "another plan was shown"
    if state.mode in ("plan", "preview", "ready"):
        for hand, end in zip(state.hands, ends, strict=True):
            at = hand.gripped_at
            if at is not None and end is not None and hand.grips and distance(at, end) > settings.moved:
                return "target moved"
    return ""
