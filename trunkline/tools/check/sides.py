"""Whether tendons bend the arm to the sides where they are described, or the base's axes are turned about it."""

import mujoco
import numpy as np

from trunkline.frames import tilt_of_gravity
from trunkline.model.arm_model import ArmModel
from trunkline.model.places import marker_places
from trunkline.recordings.trials.experiments import EXPERIMENTS, PULL
from trunkline.recordings.trials.trial import Trial

FEWEST, BESIDE = 2, 3  # trials that tell it: of all, and those beside one that differs
UPRIGHT = np.radians(5)  # of the mount, up to which an arm bends to where it is pulled
DEEP = 0.8  # of a trial's deepest pull, from which on its frames count
TOGETHER = 0.9  # of the pulls, that has to be left where they are added as vectors: the deepest takes most of others
BENT = 0.05  # of the arm's length, by which the farthest marker has to be aside
TURNED = np.radians(15)  # from which on it is said
ALIKE = 1 / 3  # of that, by which trials may differ
OTHERWISE = np.radians(25)  # from the others' mean, likewise of one trial; honest ones differ by 15° at most
BEND = 1e-4  # rad, of every joint, by which the sides of tendons are measured


def side_lines(trials: list[Trial], model: mujoco.MjModel) -> list[str]:
    """By how much trials that are pulled are bent to other sides than described: all of them the same way, or one of
    them otherwise than the others. A sentence each; none where they are not."""
    sides, places = tendon_sides(model), marker_places(model)
    turns = [(trial.name, turn) for trial in trials if (turn := _turn(trial, sides, places)) is not None]
    if len(turns) < FEWEST:
        return []
    return _all_turned(np.array([turn for _, turn in turns])) + _one_turned(turns)


def _all_turned(turns: np.ndarray) -> list[str]:
    mean, spread = _middle(turns)
    if abs(mean) <= TURNED or spread > ALIKE * abs(mean):
        return []
    problem = f"tendons bend the arm to sides that are turned by {np.degrees(mean):.0f}° about z of the base against"
    remedy = "are x and y of the base body those of the arm's description?"
    return [f"base: {problem} those where they are described, on average over {len(turns)} trials: {remedy}"]


def _one_turned(turns: list[tuple[str, float]]) -> list[str]:
    """Those trials that lie apart from the mean of the others, which have to agree among themselves."""
    lines = []
    for index, (name, turn) in enumerate(turns):
        others = np.array([other for _, other in turns[:index] + turns[index + 1 :]])
        middle, spread = _middle(others)
        apart = float(_wrapped(turn - middle))
        if len(others) >= BESIDE and abs(apart) > OTHERWISE and spread <= ALIKE * abs(apart):
            problem = f"tendons bend the arm to sides that are turned by {np.degrees(apart):.0f}° about z of the base"
            lines.append(f"base: trial {name}: {problem} against the other trials: are its poses in another frame?")
    return lines


def _middle(turns: np.ndarray) -> tuple[float, float]:
    """Mean of angles, and the median of how far they are from it; rad."""
    mean = float(np.angle(np.sum(np.exp(1j * turns))))
    return mean, float(np.median(np.abs(_wrapped(turns - mean))))


def _wrapped(angle: np.ndarray | float) -> np.ndarray:
    return np.angle(np.exp(1j * np.asarray(angle)))


def tendon_sides(model: mujoco.MjModel) -> dict[str, complex]:
    """Where each cable bends a straight arm to, x + iy in the base's axes: m it gets shorter per rad of all joints."""
    arm, data, lengths = ArmModel(model), mujoco.MjData(model), []
    mujoco.mj_kinematics(model, data)
    base = data.site("base_center").xmat.reshape(3, 3).copy()
    axes = data.xaxis[: arm.hinge_count] @ base
    for about in ([0, 0, 0], [0, -1, 0], [1, 0, 0]):  # turns of an arm along -z towards +x and +y
        data.qpos[: arm.hinge_count] = BEND * axes @ about
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        lengths.append(data.ten_length.copy())
    straight, to_x, to_y = lengths
    shorter = (straight - to_x + 1j * (straight - to_y)) / BEND
    return {name: complex(shorter[model.tendon(name).id]) for name in arm.cable_names}


def _turn(trial: Trial, sides: dict[str, complex], places: dict[str, np.ndarray]) -> float | None:
    """The angle, rad, from the side that a trial's tendons are to bend it to, to where it is; None where none tells."""
    kind = EXPERIMENTS[trial.experiment]
    at_level = kind.needs_motors and (kind.static or kind.level is PULL) and not kind.stepwise
    if not at_level or not trial.tendons or not trial.markers or tilt_of_gravity(trial.gravity) > UPRIGHT:
        return None
    pulls = np.maximum(trial.commands, 0)
    deepest = pulls.max(axis=1)
    frames = deepest >= DEEP * deepest.max()
    farthest = max(trial.markers, key=lambda name: float(np.linalg.norm(places[name])))
    visible = frames & trial.measured[:, trial.markers.index(farthest)]
    if not deepest.max() > 0 or not visible.any():
        return None
    pull = pulls[frames].mean(axis=0)
    directions = np.array([sides[name] for name in trial.tendons])
    side = complex(pull @ directions)
    aside = np.median(trial.positions[visible, trial.markers.index(farthest)], axis=0) - places[farthest]
    length = float(np.linalg.norm(places[farthest]))
    if abs(side) < TOGETHER * pull @ np.abs(directions) or np.hypot(*aside[:2]) < BENT * length or not abs(side):
        return None
    return float(np.angle(complex(aside[0], aside[1]) / side))
