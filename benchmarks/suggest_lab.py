"""The stand-in lab records single trials that are asked for: what `benchmarks.suggest` needs of it.

The arm is the lab's, what holds and moves it too; its cameras' noise is here white and without gaps, and logs are left
out, as they are no matter of what a trial tells.
"""

from dataclasses import dataclass, field

import mujoco
import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from demo.plants.bench import COMMAND_RATE, LOOSE, SAMPLE_RATE, Bench, Plant
from trunkline.frames import STANDARD_GRAVITY, wxyz_from_rotation
from trunkline.model.arm.mjcf import unit_name
from trunkline.model.elements import actuators
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial
from trunkline.tools.design.candidates import UPRIGHT, Candidate

RATE = 120.0  # Hz, of the cameras
NOISE, TURNED = 3e-4, np.radians(0.3)  # m and rad, standard deviation of each coordinate
SETTLE, STEADY = 10.0, 40.0  # s, and times the damping, as a hand steadies a tilted arm
LOOK, PULL = 0.25, 5.0  # s that an arm at rest is looked at; N of a hand that bends it by 270°
BEND, STILL, HOLD, SWING = 1.2, 0.8, 0.2, 1.0  # s, of a release


def tilt(tilt_deg: float, side_deg: float) -> Candidate:
    way, across = np.radians(side_deg), np.sin(np.radians(tilt_deg))
    gravity = np.array([across * np.cos(way), across * np.sin(way), -np.cos(np.radians(tilt_deg))])
    name = f"tilt_{tilt_deg:.0f}_{side_deg:.0f}"
    return Candidate(name, "static_tilt", "", 1.0, np.full((1, 3), -LOOSE), STANDARD_GRAVITY * gravity, tilt_deg)


def release(side_deg: float) -> Candidate:
    way = float(np.radians(side_deg))
    pulls = np.full((1, 3), -LOOSE)
    return Candidate(f"release_{side_deg:.0f}", "release", "", 1.0, pulls, UPRIGHT, turn=1.5 * np.pi, side=way)


def pull(*levels_mm: float | None) -> Candidate:
    """None for a tendon that is let out."""
    pulls = np.array([[-LOOSE if level is None else level / 1e3 for level in levels_mm]])
    name = "pull_" + "_".join("x" if level is None else f"{level:.0f}" for level in levels_mm)
    return Candidate(name, "static_pull", "", 1.0, pulls, UPRIGHT)


def started() -> list[Candidate]:
    """The three trials to begin with, which are the paper's first of each kind that needs no motor."""
    return [tilt(0, 0), tilt(30, 0), release(0)]


def fixed_list() -> list[Candidate]:
    """The rest of the paper's table in its order: tilts about one axis, releases, one tendon's curls, of which the
    shape is taken in which it is held."""
    tilts = [tilt(60, 0), tilt(90, 0)]
    return [*tilts, *(release(side) for side in (90, 180, 270)), *(pull(mm, None, None) for mm in range(20, 101, 20))]


def held_out() -> list[Candidate]:
    """To hold twins against: none is in the list, nor among the candidates."""
    tilts = [tilt(45, 70), tilt(75, 200), tilt(55, 320)]
    pulls = [pull(None, 37, None), pull(40, None, 30), pull(25, 45, None)]
    return [*tilts, release(35), release(155), release(290), *pulls]


@dataclass
class Lab:
    """plant: on the bench. tracked: indices of the units that are seen. seed: of the noise, trial by trial.
    model: whose motors the candidates' pulls are of. known: trials by name, each recorded once."""

    plant: Plant
    tracked: list[int]
    seed: int
    model: mujoco.MjModel
    known: dict[str, Trial] = field(default_factory=dict)

    def trials(self, asked: list[Candidate]) -> list[Trial]:
        new = {one.name: one for one in asked if one.name not in self.known}
        for kind in dict.fromkeys(one.kind for one in new.values()):
            self._record(kind, [one for one in new.values() if one.kind == kind])
        return [self.known[one.name] for one in asked]

    def _record(self, kind: str, asked: list[Candidate]) -> None:
        """Trials of one kind at once."""
        settle = SETTLE if kind == "static_tilt" else 0.0
        held = BEND + STILL
        span = settle + LOOK if is_static(kind) else held + HOLD + SWING
        rows = round(span * COMMAND_RATE)
        time = np.arange(rows) / COMMAND_RATE
        commands = np.repeat(np.array([self._sent(one) for one in asked])[:, None], rows, axis=1)
        hand = np.zeros_like(commands)
        if kind == "release":
            strength = np.where(time < held + HOLD, np.minimum(time / BEND, 1.0), 0.0)
            hand[:] = PULL * strength[:, None] * np.array([self._shares(one.side) for one in asked])[:, None]
        bench = Bench(
            np.array([one.gravity for one in asked]), commands, hand, np.array([one.load for one in asked]),
            steady=settle, steady_factor=STEADY, since=settle if is_static(kind) else held,
        )  # fmt: skip
        seen = self.plant.run(kind, bench, self.tracked)
        for index, one in enumerate(asked):
            self.known[one.name] = self._measured(one, seen.positions[index], seen.rotations[index])

    def _sent(self, one: Candidate) -> np.ndarray:
        """m of pull of each tendon. Shape (K,)."""
        return np.where(one.pulls[0][actuators(self.model)] > 0, one.pulls[0][actuators(self.model)], -LOOSE)

    def _shares(self, side: float) -> np.ndarray:
        """Of a hand's pull at each tendon, so that the arm bends to `side`, rad. Shape (K,)."""
        angles = 2 * np.pi * np.arange(self.plant.tendons) / self.plant.tendons
        return nnls(np.stack([np.cos(angles), np.sin(angles)]), np.array([np.cos(side), np.sin(side)]))[0]

    def _measured(self, one: Candidate, positions: np.ndarray, rotations: np.ndarray) -> Trial:
        """What cameras make of (F, S, 3) and (F, S, 3, 3) at SAMPLE_RATE, filtered as statics are: to their mean."""
        rng = np.random.default_rng([self.seed, *one.name.encode()])
        time = np.arange(0, (len(positions) - 1) / SAMPLE_RATE, 1 / RATE)
        rows = np.rint(time * SAMPLE_RATE).astype(int)
        time, positions, rotations = rows / SAMPLE_RATE, positions[rows], rotations[rows]
        static, segments = is_static(one.kind), len(self.tracked)
        positions = positions + NOISE * rng.standard_normal(positions.shape)
        turns = Rotation.from_rotvec(TURNED * rng.standard_normal((positions.shape[0] * segments, 3)))
        turned = wxyz_from_rotation(turns * Rotation.from_matrix(rotations.reshape(-1, 3, 3)))
        quaternions = turned.reshape(*positions.shape[:2], 4)
        if static:
            time, positions, quaternions = time[:1], positions.mean(axis=0)[None], quaternions[:1]
        commands = np.tile(self._sent(one), (len(time), 1))
        return Trial(
            name=one.name, experiment=one.kind, split=IDENTIFY, level=one.level, load=one.load, gravity=one.gravity,
            time=np.arange(len(time)) / RATE, segments=tuple(unit_name(unit) for unit in self.tracked),
            positions=positions, quaternions=quaternions, measured=np.ones(positions.shape[:2], bool),
            tendons=tuple(f"tendon_{k + 1}" for k in range(self.plant.tendons)), commands=commands,
            tendon_positions=commands, start=0.0 if static else HOLD,
        )  # fmt: skip
