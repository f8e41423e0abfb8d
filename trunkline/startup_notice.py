"""The first line of a command that takes seconds to load MuJoCo, torch and the rest."""

import sys


def say_loading(room: str) -> None:
    """To be called as the package `room` is imported: where `python -m room.NAME` does it, it says so.

    Python imports the package before the file that the command names; `sys.argv[0]` is "-m" while it looks for that.
    """
    name = sys.orig_argv[-1]
    if sys.argv[0] == "-m" and name.startswith(f"{room}."):
        print(f"{name.removeprefix(f'{room}.')}: loading", flush=True)
