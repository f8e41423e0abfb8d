"""Tables of an identification stage: convergence, errors over time, distances, shapes. `dvc plots` shows them."""

import numpy as np
import pandas as pd
from scipy.signal import butter, sosfiltfilt

from trunkline.frames import tilt_of_gravity
from trunkline.identification.evaluation.error_tables import LABELS, marker_table
from trunkline.identification.evaluation.evaluation import Prediction
from trunkline.identification.fit.identify import Identification
from trunkline.identification.simulate.loss import distances
from trunkline.recordings.trials.experiments import is_static

ERROR_CUTOFF = 6.0  # Hz, of the low-pass over error curves, as the paper filters its figure
SHOWN_MARKERS = 5
DRAWN = ("cad", "identified")  # models beside what was measured


def stage_tables(
    result: Identification, validate: dict[str, Prediction], markers: tuple[str, ...], shapes: bool
) -> dict[str, pd.DataFrame]:
    """By name: convergence, errors along the arm (`markers`), and of one shape a trial `shapes`, or of motions `errors`
    and of the widest of them `distances`.

    Args:
        validate: what models and baselines predict of that split.
    """
    tables = {"convergence": convergence_table(result), "markers": marker_table(validate, markers)}
    if shapes:
        return tables | {"shapes": shape_table({name: validate[name] for name in DRAWN}, markers)}
    moving = {name: prediction.of(lambda e: not is_static(e.kind)) for name, prediction in validate.items()}
    if not moving["identified"].experiments:
        return tables
    errors = error_curves({name: moving[name] for name in ("null", "null_held", *DRAWN)})
    return tables | {"errors": errors, "distances": distance_table(widest_motion(validate), markers)}


def widest_motion(validate: dict[str, Prediction]) -> dict[str, Prediction]:
    """Predictions of the one trial, of the last kind with motion, in which a marker comes furthest."""
    moving = [e for e in validate["identified"].experiments if not is_static(e.kind)]
    kind = [e for e in moving if e.kind == moving[-1].kind]
    widest = max(kind, key=lambda e: float(np.ptp(e.positions, axis=0).max()))
    return {name: validate[name].of(lambda e: e.name == widest.name) for name in DRAWN}


def convergence_table(identification: Identification) -> pd.DataFrame:
    """Columns phase, step, best, mean."""
    return pd.DataFrame(
        [
            {"phase": phase, "step": step, "best": best, "mean": mean}
            for phase, history in identification.convergence.items()
            for step, (best, mean) in enumerate(zip(history.best, history.mean, strict=True))
        ]
    )


def error_curves(predictions: dict[str, Prediction]) -> pd.DataFrame:
    """Over time, mean over trials: columns time_s, model, position_error_mm, velocity_error_mm_s, tip_error_mm.

    The first two are those of the paper's figure, of distances from the base and of their rate of change, mean over
    markers; the third is how far the tip is from where it was measured. All are low-pass filtered.
    """
    experiments = next(iter(predictions.values())).experiments
    frames = min(e.frames for e in experiments)
    step = experiments[0].frame_step
    low_pass = butter(2, ERROR_CUTOFF, fs=1 / step, output="sos")
    unseen = np.stack([~e.measured[:frames] for e in experiments], axis=1)
    tables = []
    for model, prediction in predictions.items():
        pairs = list(zip(prediction.replay.positions, experiments, strict=True))
        tip = prediction.replay.tip
        error = np.stack([(distances(p) - distances(e.positions))[:frames] for p, e in pairs], axis=1)
        rate = np.ma.array(np.gradient(error, step, axis=0), mask=unseen)
        away = np.stack([distances(p[:frames, [tip]] - e.positions[:frames, [tip]]) for p, e in pairs], axis=1)
        tables.append(
            pd.DataFrame(
                {
                    "time_s": np.arange(frames) * step,
                    "model": LABELS[model],
                    "position_error_mm": _smooth(low_pass, np.ma.array(error, mask=unseen)) * 1e3,
                    "velocity_error_mm_s": _smooth(low_pass, rate) * 1e3,
                    "tip_error_mm": _smooth(low_pass, np.ma.array(away, mask=unseen[..., [tip]])) * 1e3,
                }
            )
        )
    return pd.concat(tables)


def _smooth(low_pass: np.ndarray, errors: np.ma.MaskedArray) -> np.ndarray:
    """Mean size of (T, trials, S) errors in each frame, low-pass filtered. Shape (T,)."""
    return sosfiltfilt(low_pass, np.abs(errors).mean(axis=(1, 2)).filled(0.0))


def distance_table(predictions: dict[str, Prediction], markers: tuple[str, ...]) -> pd.DataFrame:
    """Distances from the base of a few markers in one trial: columns time_s, marker, source, distance_mm.

    Args:
        predictions: of that trial alone.
    """
    (experiment,) = next(iter(predictions.values())).experiments
    outer = len(markers) // 3  # nearer the base, distances hardly change
    chosen = np.unique(np.linspace(outer, len(markers) - 1, SHOWN_MARKERS).astype(int))
    sources = {"measured": experiment.positions} | {LABELS[m]: p.replay.positions[0] for m, p in predictions.items()}
    time = np.arange(experiment.frames) * experiment.frame_step
    return pd.concat(
        pd.DataFrame(
            {"time_s": time, "marker": markers[s], "source": source, "distance_mm": distances(positions)[:, s] * 1e3}
        )
        for source, positions in sources.items()
        for s in chosen
    )


def shape_table(predictions: dict[str, Prediction], markers: tuple[str, ...]) -> pd.DataFrame:
    """Of each trial the shape furthest from the one that it begins with, in the plane of the tilt: columns trial,
    tilt_deg, source, marker, x_mm, z_mm. Of a release that is its first swing to the other side."""
    rows = []
    for index, experiment in enumerate(next(iter(predictions.values())).experiments):
        shapes = {LABELS[model]: p.replay.positions[index] for model, p in predictions.items()}
        sources = {"measured": experiment.positions} | shapes
        from_first = np.linalg.norm(experiment.positions - experiment.positions[0], axis=2)  # (T, markers)
        farthest = int(np.nan_to_num(from_first).max(axis=1).argmax())
        for source, positions in sources.items():
            for marker, (x, _, z) in zip(markers, positions[farthest] * 1e3, strict=True):
                rows.append((experiment.name, np.degrees(tilt_of_gravity(experiment.gravity)), source, marker, x, z))
    return pd.DataFrame(rows, columns=["trial", "tilt_deg", "source", "marker", "x_mm", "z_mm"])
