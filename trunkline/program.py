"""How the command is called, for the first line of help and messages."""

COMMAND = "trunkline"


def program_name(verb: str) -> str:
    """What a verb's help calls itself, however it was started."""
    return f"{COMMAND} {verb}"
