"""Experiments made by hand, for what only compares: no model, no simulation."""

import numpy as np

from trunkline.identification.evaluation.evaluation import Replay
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.pose_fit import PoseFit
from trunkline.recordings.trials.trial import Trial

STEP = 0.01  # s
FRAMES = 250
MARKERS = ("unit_1", "unit_2", "unit_3")
TIP = 2
STRAIGHT = np.array([[0.0, 0.0, -0.1], [0.0, 0.0, -0.2], [0.0, 0.0, -0.3]])
LIKE = Replay([], 0.3, TIP, STRAIGHT)
TIME = STEP * np.arange(FRAMES)


def swing(amplitude: float = 0.05, decay: float = 4.0, turn: float = 12.0) -> np.ndarray:
    """Positions of a swing that dies away, wider towards the tip, m. Shape (T, S, 3)."""
    wave = amplitude * np.exp(-decay * TIME) * np.cos(turn * TIME)
    return STRAIGHT + wave[:, None, None] * (np.arange(1, 4)[:, None] / 3) * np.array([1.0, 0.3, 0.1])


def experiment(positions: np.ndarray, measured: np.ndarray | None = None, kind: str = "release", **more) -> Experiment:
    """Of positions (T, S, 3), m, all of them measured if not said."""
    frames = len(positions)
    visible = np.ones(positions.shape[:2], bool) if measured is None else measured
    fit = PoseFit(np.zeros(6), np.full(3, 1e-3), 1, True)
    facts = {"name": "by hand", "kind": kind, "split": "identify", "frame_step": STEP, "fit": fit} | more
    return Experiment(
        gravity=np.array([0.0, 0.0, -9.81]), start=np.zeros(6), velocity=np.zeros(6), lead=STEP,
        controls=np.zeros((frames, 0)), positions=positions, measured=visible,
        **facts,
    )  # fmt: skip


def trial(positions: np.ndarray, measured: np.ndarray | None = None, kind: str = "release", **more) -> Trial:
    """As `experiment`, a trial that begins with its first frame."""
    frames = len(positions)
    visible = np.ones(positions.shape[:2], bool) if measured is None else measured
    facts = {"name": "by hand", "experiment": kind, "split": "identify", "level": None} | more
    return Trial(
        gravity=np.array([0.0, 0.0, -9.81]), time=STEP * np.arange(frames), markers=MARKERS, positions=positions,
        quaternions=None, measured=visible, tendons=(), commands=np.zeros((frames, 0)),
        tendon_positions=np.zeros((frames, 0)), **facts,
    )  # fmt: skip
