"""Motion-capture logs in, a calibrated digital twin of a tendon-driven soft arm out.

Each verb describes its own options: `trunkline VERB --help`. `python -m trunkline` is the same.
"""

import sys
from importlib import import_module
from typing import NamedTuple

from trunkline.errors import InputError, in_one_line, nearest
from trunkline.program import COMMAND, program_name
from trunkline.version import __version__


class Verb(NamedTuple):
    """module: its `main` takes the verb's arguments. extra: of pyproject.toml, needed besides `pipeline`."""

    module: str
    line: str
    extra: str = ""


VERBS = {
    "inspect": Verb("trunkline.recordings.preparation.inspect", "topics, bodies and gaps of logs, and a session.yaml"),
    "import-motive": Verb("trunkline.recordings.preparation.motive", "logs from OptiTrack Motive's CSV exports"),
    "salvage": Verb("trunkline.tools.salvage.__main__", "a whole log of what a damaged one still has"),
    "describe": Verb("trunkline.tools.describe.__main__", "units, tendons and markers of an arm, with a drawing"),
    "check": Verb("trunkline.tools.check.__main__", "what a session can identify, before hours of fits"),
    "suggest": Verb("trunkline.tools.suggest.__main__", "which experiments to record next"),
    "record-poses": Verb("trunkline.tools.record_poses.__main__", "poses to record, to learn where the tip rests"),
    "evaluate": Verb("trunkline.tools.evaluate.__main__", "how far a model is from a session, without a fit"),
    "report": Verb("trunkline.pipeline.report", "the certificate: one page on how far the twin can be trusted"),
    "export": Verb("trunkline.tools.export.__main__", "a session beside its simulation, for Foxglove and Rerun"),
    "promote": Verb("trunkline.tools.promote.__main__", "a new twin in an old one's place, where it replays both"),
    "monitor": Verb("trunkline.tools.monitor.__main__", "whether the arm has changed since it was identified"),
    "batch": Verb("trunkline.tools.batch.__main__", "the pipeline for several arms, and one table over all of them"),
    "randomize": Verb("trunkline.tools.randomize.__main__", "domain randomization from the identified parameters"),
    "live": Verb("trunkline.ar.session.__main__", "a session in a browser or a headset", "live,hybrid,teleop"),
    "export-dataset": Verb("trunkline.ar.dataset.__main__", "live sessions as a dataset for LeRobot", "live,teleop"),
    "export-trials": Verb("trunkline.ar.dataset.trials", "any session's trials, likewise", "live,teleop"),
    "worker": Verb("trunkline.compute.worker", "a worker for a Dask scheduler", "cluster"),
}  # in the order in which a lab comes to them
RENAMED = {
    "motive": "import-motive",
    "watch": "monitor",
    "fleet": "batch",
    "randomise": "randomize",
    "demonstrations": "export-dataset",
}  # names of before, for one release
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
    if name in RENAMED:
        name = _new_name(program_name(name), RENAMED[name])
    if name not in VERBS:
        suggestion = nearest(name, list(VERBS)) or ", expected one of " + ", ".join(VERBS)
        raise InputError(f"{COMMAND}: found {name!r}, no such verb{suggestion}")
    verb = VERBS[name]
    try:
        module = import_module(verb.module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "trunkline":
            raise
        extras = ",".join(filter(None, ("pipeline", verb.extra)))
        missing = f"found no module {error.name!r}, expected what `pip install 'trunkline[{extras}]'` brings"
        raise InputError(f"{program_name(name)}: {missing}") from error
    return module.main(rest)


def inspect_by_old_name() -> int:
    """The console script `trunkline-inspect`, for one release."""
    return main([_new_name(f"{COMMAND}-inspect", "inspect"), *sys.argv[1:]])


def import_motive_by_old_name() -> int:
    """The console script `trunkline-motive`, for one release."""
    return main([_new_name(f"{COMMAND}-motive", "import-motive"), *sys.argv[1:]])


def _new_name(old: str, verb: str) -> str:
    """`verb`, after a line on stderr about the old spelling of its command."""
    print(f"{old} is now `{program_name(verb)}`; the old name goes with the next release", file=sys.stderr)
    return verb


if __name__ == "__main__":
    sys.exit(main())
