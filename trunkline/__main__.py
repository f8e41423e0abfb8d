"""Motion-capture logs in, a calibrated digital twin of a tendon-driven soft arm out.

Each verb tells its own options: `trunkline VERB --help`. `python -m trunkline` is the same command.
"""

import sys
from importlib import import_module
from typing import NamedTuple

from trunkline.errors import InputError, in_one_line, nearest
from trunkline.program import COMMAND, set_program_name
from trunkline.version import __version__


class Verb(NamedTuple):
    """module: whose `main` takes the verb's arguments. extra: of pyproject.toml, what it needs besides `pipeline`."""

    module: str
    line: str
    extra: str = ""


VERBS = {
    "inspect": Verb("trunkline.recordings.preparation.inspect", "what logs hold, and a session.yaml for them"),
    "motive": Verb("trunkline.recordings.preparation.motive", "OptiTrack Motive's CSV exports as logs of a session"),
    "describe": Verb("trunkline.tools.describe.__main__", "what an arm's description gives, in words and drawn"),
    "check": Verb("trunkline.tools.preflight.__main__", "what a session will and will not tell, before hours of fits"),
    "suggest": Verb("trunkline.tools.design.__main__", "which experiments to record next"),
    "evaluate": Verb("trunkline.tools.evaluate.__main__", "how far a model is from a session, without a fit"),
    "report": Verb("trunkline.pipeline.report", "the certificate: one page on how far the twin can be trusted"),
    "watch": Verb("trunkline.tools.monitor.__main__", "whether the arm has changed since it was identified"),
    "fleet": Verb("trunkline.tools.batch.__main__", "several arms beside each other"),
    "randomise": Verb(
        "trunkline.tools.randomize.__main__", "what was identified, as domain randomisation for learning"
    ),
    "live": Verb("trunkline.ar.session.__main__", "a session in a browser or a headset", "live,hybrid,teleop"),
    "demonstrations": Verb(
        "trunkline.ar.dataset.__main__",
        "what operators did in live sessions, as a dataset for LeRobot",
        "live,teleop",
    ),
}  # in the order in which a lab comes to them
HELP = ("-h", "--help")


def overview() -> str:
    """What `trunkline --help` prints."""
    width = max(map(len, VERBS))
    lines = [f"  {name:{width}}  {verb.line}" for name, verb in VERBS.items()]
    return "\n".join([f"usage: {COMMAND} VERB [ARGUMENT...]", "", (__doc__ or "").strip(), "", *lines])


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    words = sys.argv[1:] if arguments is None else arguments
    if not words or words[0] in HELP:
        print(overview())
        return 0 if words else 2
    name, *rest = words
    if name == "--version":
        print(f"{COMMAND} {__version__}")
        return 0
    if name not in VERBS:
        meant = nearest(name, list(VERBS)) or ", expected one of " + ", ".join(VERBS)
        raise InputError(f"{COMMAND}: found {name!r}, no such verb{meant}")
    verb = VERBS[name]
    try:
        module = import_module(verb.module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "trunkline":
            raise
        extras = ",".join(filter(None, ("pipeline", verb.extra)))
        problem = f"found no module {error.name!r}, expected what `pip install 'trunkline[{extras}]'` brings"
        raise InputError(f"{COMMAND} {name}: {problem}") from error
    set_program_name(name)
    return module.main(rest)


if __name__ == "__main__":
    sys.exit(main())
