"""What the filter did to a trial, and to a session in a few numbers."""

from dataclasses import dataclass

import numpy as np

from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.trial import Trial


@dataclass
class Effect:
    """samples: of all markers on the uniform clock. gap_share, filled_share: not trusted, filled in.
    outliers: samples dropped.

    position_noise (m), angle_noise (rad): root mean square of what the filter took away, per axis.
    tilt: rad, measured. motion: m, how far the markers still move in a static tilt (standard deviation).
    base_shift (m), base_turn (rad): of the mount within the trial.
    """

    samples: int
    gap_share: float
    filled_share: float
    outliers: int
    position_noise: float
    angle_noise: float | None
    tilt: float
    motion: float | None
    base_shift: float
    base_turn: float


def summary(trials: list[Trial], effects: list[Effect]) -> dict:
    """The filtered session in a few numbers, for metrics.json. Shares are of all samples."""
    static, moving = {}, {}
    for trial, effect in zip(trials, effects, strict=True):
        kind = EXPERIMENTS[trial.experiment]
        if kind.static:
            assert effect.motion is not None, "the filter measures it in every static trial"
            level = {} if kind.level is None else {f"level_{kind.level.unit}": trial.level}
            static[trial.name] = level | {
                "tilt_deg": float(np.degrees(effect.tilt)),
                "motion_mm": 1e3 * effect.motion,
            }
        else:
            moving[trial.name] = {
                "start_s": trial.start,
                "start_sigma_s": trial.start_sigma,
                "in_motion": trial.in_motion,
                "swaying": trial.swaying,
                "duration_s": float(trial.time[-1]),
            }
    angles = [effect.angle_noise for effect in effects if effect.angle_noise is not None]
    weights = [effect.samples for effect in effects]
    return {
        "trials": len(trials),
        "outliers": sum(effect.outliers for effect in effects),
        "gap_share": float(np.average([effect.gap_share for effect in effects], weights=weights)),
        "filled_share": float(np.average([effect.filled_share for effect in effects], weights=weights)),
        "removed_position_mm": 1e3 * float(np.median([effect.position_noise for effect in effects])),
        "removed_orientation_deg": float(np.degrees(np.median(angles))) if angles else None,
        "base_shift_mm": 1e3 * np.max([effect.base_shift for effect in effects]),
        "base_turn_deg": float(np.degrees(np.max([effect.base_turn for effect in effects]))),
        "static": static,
        "moving": moving,
    }
