"""The one next action, in words, for whom controls and for whom watches: by controllers, and by mouse and keyboard."""

from dataclasses import dataclass

from trunkline.ar.teleop.messages import Mode, Targets

NEXT: dict[Mode, str] = {
    "hold": "let go of grips and triggers for a moment",
    "aim": "hold a grip to move the end of its ray; pull the trigger to ask for a plan",
    "plan": "wait for the plan",
    "preview": "watch the preview to its end",
    "ready": "hold a grip and pull the trigger to confirm, or aim anew",
    "delay": "keep the grip held; let go to take it back",
    "execute": "keep a grip held while the robot moves; let go to hold it",
    "follow": "move the rays; let go of both grips to hold",
    "stopped": "press primary to go on",
}
BY_KEYS: dict[Mode, str] = {
    **NEXT,
    "hold": "let go of all keys for a moment",
    "aim": "drag a target, or press Enter to ask for a plan",
    "ready": "hold G and press Enter to confirm, or move a target",
    "delay": "keep G held; let go to take it back",
    "execute": "keep G held while the robot moves; let go to hold it",
    "follow": "move the targets; F, or letting go of G, ends it",
    "stopped": "press R to go on",
}


@dataclass(frozen=True)
class InputDevice:
    """What a user has in hand, in words. modes: what is next. go_on: ends a stop; offered: takes the point that is.
    names: of the rigid and of the tip target; sets: how one is set, its name left open; asks: for a plan."""

    modes: dict[Mode, str]
    go_on: str
    offered: str
    names: tuple[str, str]
    sets: str
    asks: str


CONTROLLERS = InputDevice(
    NEXT, "primary", "primary, the grip let go,", ("rigid", "tip"), "hold a grip to set the {} target",
    "pull the trigger",
)  # fmt: skip
KEYBOARD = InputDevice(
    BY_KEYS, "R", "R", ("the mount’s", "the tip’s"), "drag {} marker, or move it by arrows (1: mount, 2: tip)",
    "press Enter",
)  # fmt: skip


def next_action(mode: Mode, targets: Targets | None, holder: str, aligned: bool, touched: tuple[bool, bool]) -> str:
    """By controllers. touched: whether the rigid and the tip target have been set."""
    if holder and not aligned:
        return "align the base"
    return _next(CONTROLLERS, mode, targets, holder, touched)


def next_key(mode: Mode, targets: Targets | None, holder: str, touched: tuple[bool, bool]) -> str:
    """By mouse and keyboard, where the base is where it is; as `next_action`."""
    return _next(KEYBOARD, mode, targets, holder, touched)


def _next(device: InputDevice, mode: Mode, targets: Targets | None, holder: str, touched: tuple[bool, bool]) -> str:
    if not holder:
        then = f", then press {device.go_on}" if mode == "stopped" else "; anybody may stop the robot"
        return f"take control{then}"
    if mode != "aim":
        return device.modes[mode]
    if targets is None:
        missing = " and ".join(name for name, there in zip(device.names, touched, strict=True) if not there)
        return device.sets.format(missing or device.names[1])
    if targets.rigid.reach == "outside" or targets.tip.reach == "outside":
        return f"bring the target within reach, or press {device.offered} for the point that is offered"
    if targets.rigid.reach == "blocked" or targets.tip.reach == "blocked":
        return "bring the target out of the obstacle"
    if targets.object:
        return f"{device.asks} to ask for a plan for {targets.object}"
    return device.modes[mode]
