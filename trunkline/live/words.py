"""The one next action, in words, for whom controls and for whom watches."""

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


def next_action(mode: Mode, targets: Targets | None, holder: str, aligned: bool, touched: tuple[bool, bool]) -> str:
    """touched: whether the rigid and the tip target have been set."""
    if not holder:
        return "ask for control" + (", then press primary" if mode == "stopped" else "; anybody may stop the robot")
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
