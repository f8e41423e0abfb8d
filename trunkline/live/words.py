"""The one next action, in words, for whom controls and for whom watches: by controllers, and by mouse and keyboard."""

from trunkline.teleop.messages import Mode, Targets

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
NAMES = "mount", "tip"  # of the targets, as the page has them
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


def next_action(mode: Mode, targets: Targets | None, holder: str, aligned: bool, touched: tuple[bool, bool]) -> str:
    """By controllers. touched: whether the rigid and the tip target have been set."""
    if not holder:
        return "take control" + (", then press primary" if mode == "stopped" else "; anybody may stop the robot")
    if not aligned:
        return "align the base"
    if mode != "aim":
        return NEXT[mode]
    if targets is None:
        missing = " and ".join(name for name, there in zip(("rigid", "tip"), touched, strict=True) if not there)
        return f"hold a grip to set the {missing or 'tip'} target"
    if targets.rigid.reach == "outside" or targets.tip.reach == "outside":
        return "bring the target within reach, or press primary, the grip let go, for the point that is offered"
    if targets.rigid.reach == "blocked" or targets.tip.reach == "blocked":
        return "bring the target out of the solid"
    if targets.thing:
        return f"pull the trigger to ask for a plan for {targets.thing}"
    return NEXT[mode]


def next_key(mode: Mode, targets: Targets | None, holder: str, touched: tuple[bool, bool]) -> str:
    """By mouse and keyboard, where the base is where it is; as `next_action`."""
    if not holder:
        return "take control" + (", then press R" if mode == "stopped" else "; anybody may stop the robot")
    if mode != "aim":
        return BY_KEYS[mode]
    if targets is None:
        missing = " and ".join(f"the {name}’s" for name, there in zip(NAMES, touched, strict=True) if not there)
        return f"drag {missing or 'the tip’s'} marker, or move it by arrows (1: mount, 2: tip)"
    if targets.rigid.reach == "outside" or targets.tip.reach == "outside":
        return "bring the target within reach, or press R for the point that is offered"
    if targets.rigid.reach == "blocked" or targets.tip.reach == "blocked":
        return "bring the target out of the solid"
    if targets.thing:
        return f"press Enter to ask for a plan for {targets.thing}"
    return BY_KEYS[mode]
