"""The diagram of modes in docs/teleoperation.md, of the core's table: `python -m upkeep.state_diagram` prints it."""

from trunkline.ar.teleop.transitions import TRANSITIONS


def diagram() -> str:
    """The table as a Mermaid state diagram; what leads to a stop or a hold from nearly everywhere is drawn once."""
    groups = {"stop": ("every mode", "stopped"), "lost": ("every mode but stopped", "hold")}
    lines = ["stateDiagram-v2", "  [*] --> hold"]
    for (mode, event), after in TRANSITIONS.items():
        if event not in groups:
            lines.append(f"  {mode} --> {after}: {event}")
    for event, (where, after) in groups.items():
        lines += [f"  note right of {after}", f"    {event}, from {where}", "  end note"]
    return "\n".join(lines)


if __name__ == "__main__":
    print(diagram())
