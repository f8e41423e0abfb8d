"""A filtered trial: every marker and tendon on one uniform clock, in the base frame.

This is what the identification stages read. Positions in metres in the base frame (origin at the arm's mount,
arm along -z when straight), quaternions (w, x, y, z), time in seconds from the trial's first frame.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from trunkline.recordings.trials.recording import TrialRecording
from trunkline.recordings.trials.tables import (
    COUNT,
    FLAG,
    NUMBER,
    VECTOR,
    long_table,
    planned,
    pose_table,
    read_tables,
    stack,
    write_tables,
)

COLUMNS = {
    "gravity": VECTOR, "start": NUMBER, "start_sigma": NUMBER, "in_motion": FLAG, "swaying": FLAG, "repairs": COUNT,
    "approach": COUNT,
}  # fmt: skip


@dataclass(kw_only=True)
class Trial(TrialRecording):
    """One experiment of T frames, S markers and K tendons.

    name, experiment, split, level, load: as planned, see `PlannedTrial`. markers: S names, tendons: K names, as in the
    model.
    gravity: (3,) m/s² in the base frame, measured from the base body.
    time: (T,) s, uniform. A static trial is averaged over time and has T = 1.
    positions: (T, S, 3) m. quaternions: (T, S, 4) wxyz, hemisphere-continuous; None where the log has none.
    measured: (T, S) False where a sample was bridged over a gap too long to trust.
    commands, tendon_positions: (T, K) m of pull from the straight arm's path length, on the same clock.
    start: s, when it begins: the detected release, or the beginning of the curl cycle; 0 for a static trial.
    start_sigma: s, standard error of `start`; 0 for a static trial.
    in_motion: whether the arm moves at `start` already.
    swaying: whether a hand still moved it when it let go, so that it starts with the velocity that it had before.
    repairs: how many `ingest` made in it.
    approach: of an arm that motors hold at rest, 1 if they drew it there, -1 if they let it come back from beyond, 0 if
    the commands do not say so.
    """

    gravity: np.ndarray
    measured: np.ndarray
    start: float = 0.0
    start_sigma: float = 0.0
    in_motion: bool = False
    swaying: bool = False
    repairs: int = 0
    approach: int = 0


def sessions_of(trials: list[Trial]) -> list[str]:
    """Names of the sessions to which trials belong, in their order; [""] where there is one."""
    return list(dict.fromkeys(trial.session for trial in trials))


def write_trials(folder: Path, trials: list[Trial]) -> None:
    """Write trials.parquet (a row a trial), poses.parquet (a row a frame and marker) and commands.parquet
    (a row a frame and tendon) into `folder`, in the order of `trials`."""
    poses = [
        pose_table(t.name, t.time, t.markers, t.positions, t.quaternions).append_column(
            "measured", pa.array(t.measured.ravel())
        )
        for t in trials
    ]
    commands = [
        long_table(t.name, t.time, "tendon", t.tendons, {"command": t.commands, "position": t.tendon_positions})
        for t in trials
    ]
    write_tables(folder, trials, COLUMNS, {"frames": "time"}, poses, commands)


def read_trials(folder: Path, splits: tuple[str, ...]) -> list[Trial]:
    """The trials of `splits` that `write_trials` wrote into `folder`, in the same order; InputError as `read_tables`.

    Only the stage `score` may ask for the test split.
    """
    rows, poses, commands = read_tables(folder, "filter")
    trials, pose_row, command_row = [], 0, 0
    for row in rows:
        shape = (row["frames"], len(row["markers"]))
        pose = {key: column[pose_row : pose_row + shape[0] * shape[1]] for key, column in poses.items()}
        pose_row += shape[0] * shape[1]
        command_shape = (row["frames"], len(row["tendons"]))
        count = command_shape[0] * command_shape[1]
        command = {key: column[command_row : command_row + count] for key, column in commands.items()}
        command_row += count
        trials.append(
            Trial(
                **planned(row, COLUMNS),
                time=pose["time"].reshape(shape)[:, 0].copy(),
                positions=stack(pose, ("x", "y", "z"), shape),
                quaternions=stack(pose, ("qw", "qx", "qy", "qz"), shape) if row["orientations"] else None,
                measured=pose["measured"].reshape(shape),
                commands=command["command"].reshape(command_shape),
                tendon_positions=command["position"].reshape(command_shape),
            )
        )
    return [trial for trial in trials if trial.split in splits]
