"""How a command was called, for the first line of its help."""

import sys

COMMAND = "trunkline"


def program_name(module: str) -> str:
    """`trunkline VERB` where the command `trunkline` called, as `sys.argv[0]` says; else `python -m module`."""
    program = sys.argv[0] if sys.argv else ""
    return program if program.startswith(f"{COMMAND} ") else f"python -m {module}"


def set_program_name(verb: str) -> None:
    """For all of this process: the parsers of the verb ask `called`."""
    sys.argv[0] = f"{COMMAND} {verb}"
