"""A session's trials as a dataset for LeRobot: `trunkline export-trials SESSION... --out FOLDER`

SESSION is what `trunkline evaluate` takes, such as one that a twin was identified from. An episode is a trial: its
state is where the markers are and what the motors measured, its environment gravity and the load at the tip, its
action what was commanded; a session that lacks one of the two has the other in its place. Trials of the split `test`
are left out. `LeRobotDataset("any/name", root="FOLDER")` opens it.
"""

import sys
from pathlib import Path

import numpy as np

from trunkline.ar.dataset.dataset import write_dataset
from trunkline.ar.dataset.episodes import ACTION, DONE, ENVIRONMENT, STATE, SUCCESS, XYZ, Episode
from trunkline.ar.dataset.recording import AxisSeries
from trunkline.errors import InputError, in_one_line
from trunkline.identification.simulate.experiment import SLACK
from trunkline.pipeline.stage import output_folder
from trunkline.program import add_settings, command_parser
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_static
from trunkline.recordings.trials.splits import DECIDING
from trunkline.recordings.trials.trial import Trial
from trunkline.tools.evaluate.session import trials_of

MEASURED = "observation.measured"


def episode_of(trial: Trial, tendons: tuple[str, ...], fps: int) -> Episode:
    """A trial at even times: a frame has what was measured by then, its action is what was commanded by the next frame.
    Shapes at rest follow each other a frame apart, and an action is that of its own frame.

    Args:
        tendons: of all trials; those that this one does not command are slack. Without any there is no action.
    """
    still = is_static(trial.experiment)
    recorded = np.arange(len(trial.time)) / fps if still else trial.time - trial.time[0]
    times = np.arange(len(recorded) if still else int(recorded[-1] * fps + 1e-6) + 1) * 1_000_000_000 // fps
    stamps = np.round(recorded * 1e9).astype(np.int64)
    axes = tuple(f"{marker}.{axis}" for marker in trial.markers for axis in XYZ)
    ahead = 0 if still else 1_000_000_000 // fps

    def at(moments: np.ndarray, values: np.ndarray) -> np.ndarray:
        return AxisSeries(stamps, values, ()).at(moments + 1000)  # ns: times of the trial are rounded

    pulls, commands = (_of_all(trial, values, tendons) for values in (trial.tendon_positions, trial.commands))
    count = len(times)
    frames = {
        STATE: at(times, np.concatenate([trial.positions.reshape(len(recorded), -1), pulls], axis=1)),
        MEASURED: at(times, trial.measured.astype(float)),
        ENVIRONMENT: np.tile([*trial.gravity, trial.load], (count, 1)),
        DONE: np.arange(count) == count - 1,
        SUCCESS: np.arange(count) == count - 1,
    } | ({ACTION: at(times + ahead, commands)} if tendons else {})
    names = {
        STATE: (*axes, *(f"{name}.pos" for name in tendons)),
        MEASURED: trial.markers,
        ENVIRONMENT: (*(f"gravity.{axis}" for axis in XYZ), "load"),
    } | ({ACTION: tuple(f"{name}.pos" for name in tendons)} if tendons else {})
    return Episode(EXPERIMENTS[trial.experiment].what, True, "done", frames, names)


def _of_all(trial: Trial, values: np.ndarray, tendons: tuple[str, ...]) -> np.ndarray:
    """Pulls (T, K) of the trial's own tendons as those of all `tendons`, m."""
    every = np.full((len(values), len(tendons)), -SLACK)
    every[:, [tendons.index(name) for name in trial.tendons]] = values
    return every


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("export-trials", __doc__)
    parser.add_argument("sessions", type=Path, nargs="+", metavar="SESSION")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="of the dataset; it must not exist")
    parser.add_argument("--fps", type=int, default=30, help="frames a second")
    parser.add_argument("--robot", default="soft_arm", metavar="NAME", help="what the dataset calls the arm")
    add_settings(parser)
    args = parser.parse_args(arguments)
    if args.fps < 1:
        raise InputError(f"--fps: found {args.fps}, expected 1 or more")
    if args.out.exists():
        raise InputError(f"--out: {args.out}: found something there, expected a new folder")
    every = [(path, trial) for path in args.sessions for trial in trials_of(path, args.settings, "export-trials")]
    trials = [(path, trial) for path, trial in every if trial.split in DECIDING]
    if not trials:
        raise InputError(f"SESSION: found no trial of {' or '.join(DECIDING)}, expected one")
    markers = trials[0][1].markers
    for path, trial in trials:
        if trial.markers != markers:
            raise InputError(f"{path}: trial {trial.name}: found other markers than in the first session")
        if not all(np.isfinite(v).all() for v in (trial.positions, trial.commands, trial.tendon_positions)):
            raise InputError(f"{path}: trial {trial.name}: found a gap, expected a number for each frame")
    tendons = tuple(dict.fromkeys(name for _, trial in trials for name in trial.tendons))
    episodes = [episode_of(trial, tendons, args.fps) for _, trial in trials]
    with output_folder(args.out) as folder:
        write_dataset(folder, episodes, args.fps, args.robot)
    count = sum(len(episode.frames[STATE]) for episode in episodes)
    left_out = f"; {len(every) - len(trials)} trials of the other split left out" if len(every) > len(trials) else ""
    print(f"export-trials: {len(episodes)} episodes, {count} frames at {args.fps} a second, in {args.out}{left_out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
