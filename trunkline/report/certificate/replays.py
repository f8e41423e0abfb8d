"""The trials as the page replays them: measured and simulated arm, frame by frame, in few bytes."""

import base64

import mujoco
import numpy as np

from trunkline.identification.evaluation.evaluation import Prediction
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import EXPERIMENTS

UNIT = 5e-5  # m, of a number: ± 1.6 m
LOST = -32768  # of a point that was not seen
THINNEST = 3e-3  # m, as which a marker without a shape is drawn
FASTEST = 40.0  # frames a second, at most


def packed(prediction: Prediction, model: mujoco.MjModel, markers: tuple[str, ...]) -> dict:
    """Of what a model says of some trials, beside what was measured: for `client/src/certificate/replays.js`.

    Each trial has its measured frames, then its simulated ones; a frame has the mount and then the markers from the
    base on, a point its x, y and z in 16 bits.
    """
    sites = ArmModel(model).marker_sites(markers)
    order = np.argsort(np.linalg.norm(prediction.replay.straight, axis=1))
    site_geoms = [model.geom_bodyid == body for body in model.site_bodyid[sites[order]]]
    radii = [model.geom_size[shapes, 0].max(initial=THINNEST) for shapes in site_geoms]
    rows, parts, offset = [], [], 0
    step = next((e.frame_step for e in prediction.experiments if e.frame_step), 1 / FASTEST)
    every = max(1, round(1 / (FASTEST * step)))
    for experiment, positions in zip(prediction.experiments, prediction.replay.positions, strict=True):
        measured = np.where(experiment.measured[..., None], experiment.positions, np.nan)
        both = [_whole(points[::every][:, order]) for points in (measured, positions)]
        parts += both
        group = f"{EXPERIMENTS[experiment.kind].plural}, {experiment.split}"
        rows.append({"name": experiment.name, "group": group, "frames": len(both[0]), "offset": offset})
        offset += sum(part.size for part in both)
    data = np.concatenate([part.ravel() for part in parts]) if parts else np.zeros(0, "<i2")
    return {
        "trials": rows,
        "frames_per_s": 1 / (every * step),
        "unit_m": UNIT,
        "radii_m": [float(f"{radius:.4g}") for radius in [max(radii, default=0.01), *radii]],
        "data": base64.b64encode(data.tobytes()).decode(),
    }


def _whole(points: np.ndarray) -> np.ndarray:
    """Points (T, S, 3), m, NaN where not seen, with the mount before them, as numbers of `UNIT`."""
    mounted = np.concatenate([np.zeros((len(points), 1, 3)), points], axis=1) / UNIT
    limited = np.clip(np.round(mounted), LOST + 1, -LOST - 1)
    return np.where(np.isfinite(mounted), limited, LOST).astype("<i2")
