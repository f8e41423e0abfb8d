"""The state machine as a table: which event leads from which mode to which. What is not in it is forbidden."""

from typing import Literal, get_args

from trunkline.ar.teleop.messages import Mode

# In the order in which they count where several come at once: what stops the robot comes first.
Event = Literal[
    "stop", "fault", "lost", "void", "released", "refused", "settled", "reset",
    "ask", "planned", "shown", "confirm", "elapsed", "done", "follow", "unfollow",
]  # fmt: skip
EVENTS: tuple[Event, ...] = get_args(Event)
MODES: tuple[Mode, ...] = get_args(Mode)

MEANING: dict[Event, str] = {
    "stop": "secondary button",
    "fault": "the robot reports a fault, or does not start",
    "lost": "clock, alignment or package is not sound; but in plan, preview, ready also: a controller, the client",
    "void": "target, world or alignment changed",
    "released": "both grips let go",
    "refused": "no plan, with the reason",
    "settled": "all sound for a while, grips and triggers let go",
    "reset": "primary button",
    "ask": "trigger, both targets within reach",
    "planned": "the plan is there",
    "shown": "its preview has been shown to its end",
    "confirm": "trigger pressed afresh, a grip held",
    "elapsed": "the delay is over",
    "done": "the robot has arrived",
    "follow": "stick pressed, a grip held",
    "unfollow": "stick pressed",
}

TRANSITIONS: dict[tuple[Mode, Event], Mode] = {
    ("hold", "settled"): "aim",
    ("aim", "ask"): "plan",
    ("aim", "follow"): "follow",
    ("plan", "planned"): "preview",
    ("plan", "refused"): "aim",
    ("preview", "shown"): "ready",
    ("ready", "confirm"): "delay",
    ("delay", "released"): "ready",
    ("delay", "elapsed"): "execute",
    ("execute", "done"): "aim",
    ("execute", "released"): "hold",
    ("execute", "void"): "hold",
    ("follow", "unfollow"): "aim",
    ("follow", "released"): "hold",
    ("follow", "void"): "hold",
    ("stopped", "reset"): "hold",
}
TRANSITIONS |= {(mode, "void"): "aim" for mode in ("plan", "preview", "ready", "delay")}
TRANSITIONS |= {(mode, "lost"): "hold" for mode in MODES if mode not in ("hold", "stopped")}
TRANSITIONS |= {(mode, "fault"): "stopped" for mode in ("execute", "follow")}
TRANSITIONS |= {(mode, "stop"): "stopped" for mode in MODES if mode != "stopped"}


def first_event(mode: Mode, events: dict[Event, bool]) -> Event | None:
    """Of the `events` that are true, the first that `mode` answers to."""
    return next((event for event in EVENTS if events.get(event) and (mode, event) in TRANSITIONS), None)
