"""Asking the network's file: a pose that is none is an error, not plausible lengths."""

import json

import numpy as np
import onnxruntime

from trunkline.errors import InputError
from trunkline.kinematics.ik.inputs import gravity_columns, position_of
from trunkline.recordings.trials.conditions import PULLED

SAME_TILT = 0.01  # deg, of rounding
UNIT = 1e-3  # by which the length of a quaternion or direction may differ from 1: that of one written with three digits


def ask(runtime: onnxruntime.InferenceSession, poses: np.ndarray) -> dict[str, np.ndarray]:
    """What the network of `train_ik` answers, by the name of the output.

    "commands" and "lengths" (N, K) and "tip" (N, 3) as in `network.Answer`, m, and "doubtful" (N,): whether the tip is
    foreseen so far from its target that the arm cannot take the pose. "unsure" (N,): whether the motors pull by more in
    all than up to where the certificate has the arm's tip within 1 % of its length from there, or the mount is tilted
    further than in the session's trials with a pull, or without; true where the file has no such limits.

    Args:
        poses: gravity (angle in rad, or a unit vector), tip position (m) and unit quaternion (w first, either sign) in
            the base frame, as the file's `inputs` name them. Shape (N, 7, 8 or 10).

    Raises:
        InputError: the shape is another, a number is not finite, a quaternion or direction is not of unit length, or
            the network has no finite answer.
    """
    (taken,), meaning = runtime.get_inputs(), runtime.get_modelmeta().custom_metadata_map
    for key in ("inputs", "doubt_beyond_m"):
        if key not in meaning:
            raise InputError(f"found no {key!r} in the file's metadata, expected a network of train_ik")
    names = [output.name for output in runtime.get_outputs()]
    inputs = {taken.name: checked(poses, json.loads(meaning["inputs"]))}
    answers = dict(zip(names, runtime.run(names, inputs), strict=True))
    for name, values in answers.items():
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(bad):
            raise InputError(f"pose {bad[0]}: found {name} {values[bad[0]]}, expected finite numbers")
    missed = np.linalg.norm(answers["tip"] - position_of(inputs[taken.name]), axis=1)
    unsure = _unsure(answers, inputs[taken.name], meaning)
    return answers | {"doubtful": missed > float(meaning["doubt_beyond_m"]), "unsure": unsure}


def _unsure(answers: dict[str, np.ndarray], poses: np.ndarray, meaning: dict[str, str]) -> np.ndarray:
    if "sure_pulls_m" not in meaning:
        return np.ones(len(poses), bool)
    pulls = np.maximum(np.array(json.loads(meaning["straight_lengths_m"])) - answers["commands"], 0)
    loose, pulled = json.loads(meaning["sure_tilts_deg"])
    most = np.where((pulls > PULLED).any(axis=1), pulled, loose)
    return (pulls.sum(axis=1) > float(meaning["sure_pulls_m"])) | (tilts_of(poses) > most + SAME_TILT)


def tilts_of(poses: np.ndarray) -> np.ndarray:
    """Angles between the straight arm and gravity, deg; 0 where nothing pulls at it. (N, 7, 8 or 10) to (N,)."""
    gravity = gravity_columns(poses).astype(float)
    if gravity.shape[1] == 3:
        return np.degrees(np.arctan2(np.linalg.norm(gravity[:, :2], axis=1), -gravity[:, 2]))
    return np.degrees(np.abs(gravity).sum(axis=1))


def checked(poses: np.ndarray, inputs: list[str]) -> np.ndarray:
    """The poses in the network's precision, if they are poses; `inputs` names their columns, the quaternion last."""
    try:
        poses = np.asarray(poses, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"poses: {error}, expected numbers of shape (N, {len(inputs)})") from None
    if poses.ndim != 2 or poses.shape[1] != len(inputs):
        raise InputError(f"poses: found shape {poses.shape}, expected (N, {len(inputs)}): {', '.join(inputs)}")
    with np.errstate(over="ignore"):
        single = poses.astype(np.float32)
    for row, column in np.argwhere(~np.isfinite(single)):
        raise InputError(f"pose {row}: {inputs[column]}: found {poses[row, column]:g}, expected a finite number")
    units = {"quaternion": poses[:, -4:]}
    if len(inputs) > 8:
        units["direction of gravity"] = gravity_columns(poses)
    for name, vectors in units.items():
        lengths = np.linalg.norm(vectors, axis=1)
        for row in np.flatnonzero(np.abs(lengths - 1) > UNIT):
            raise InputError(f"pose {row}: found a {name} of length {lengths[row]:.4g}, expected unit length")
    return single
