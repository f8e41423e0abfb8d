"""A session beside its simulation, for Foxglove, Rerun and PlotJuggler: `trunkline export MODEL SESSION OUT.mcap`

Trials come one after another, a second apart: bodies as measured and as simulated, the arm's shape in both, commands,
pulls, and errors in mm over time. Beside OUT.mcap a layout is written that Foxglove imports. All splits are shown:
choose nothing by what you see of `test`.
"""

import argparse
import json
import sys
from pathlib import Path

from threadpoolctl import threadpool_limits

from trunkline.errors import InputError, in_one_line, nearest
from trunkline.files import written_whole
from trunkline.identification.simulate.checks import check_trials
from trunkline.model.places import marker_places
from trunkline.program import add_settings, command_parser
from trunkline.recordings.trials.trial import Trial
from trunkline.tools.evaluate.model import written_beside
from trunkline.tools.evaluate.session import trials_of
from trunkline.tools.export.recording import Recording, layout
from trunkline.tools.export.tracks import tracks
from trunkline.twin.twin import Twin

LAYOUT = ".foxglove.json"  # ends the name of the layout's file


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("export", __doc__)
    parser.add_argument("model", type=Path, metavar="MODEL", help="a twin: artifacts, an MJCF or a Unity package")
    parser.add_argument("session", type=Path, metavar="SESSION", help="as of `trunkline evaluate`")
    parser.add_argument("out", type=Path, metavar="OUT.mcap", help="is written; must not be there yet")
    parser.add_argument("--trial", action="append", default=[], metavar="NAME", help="this one alone; may be repeated")
    add_settings(parser)
    args = parser.parse_args(arguments)
    if args.out.suffix != ".mcap" or args.out.exists():
        actual = "a file" if args.out.exists() else "another ending"
        raise InputError(f"{args.out}: found {actual}, expected a name that is free and ends in .mcap")
    if not args.out.parent.is_dir():
        raise InputError(f"{args.out.parent}: found no such folder, expected one to write {args.out.name} into")
    with threadpool_limits(1, user_api="blas"):  # as the stages: sums depend on how many cores there are
        return _run(args)


def _run(args: argparse.Namespace) -> int:
    twin = Twin.load(args.model)
    written = written_beside(twin, args.settings)
    trials = trials_of(args.session, args.settings, "export", marker_places(twin.arm.model))
    trials = written.as_fitted(_chosen(trials, args.trial))
    check_trials(trials, twin.arm.model)
    print(f"export: simulating {len(trials)} trials", flush=True)
    tendons = list(dict.fromkeys(name for trial in trials for name in trial.tendons))
    with written_whole(args.out) as part, open(part, "wb") as file:
        recording = Recording(file, twin.arm, trials[0].markers, tendons)
        for track in tracks(twin.arm, trials, written):
            recording.add(track)
        recording.finish()
    beside = args.out.with_suffix(LAYOUT)
    beside.write_text(json.dumps(layout(tendons, trials[0].command_unit), indent=2) + "\n", encoding="utf-8")
    print(f"export: {args.out}: {args.out.stat().st_size / 1e6:.1f} MB; in Foxglove with the layout {beside.name}")
    return 0


def _chosen(trials: list[Trial], names: list[str]) -> list[Trial]:
    """Those of these names, in the session's order; all where none are named."""
    every = [trial.name for trial in trials]
    for name in set(names) - set(every):
        expected = nearest(name, every) or ", expected one of " + ", ".join(every)
        raise InputError(f"--trial: found no trial {name!r}{expected}")
    return [trial for trial in trials if trial.name in (names or every)]


if __name__ == "__main__":
    sys.exit(main())
