"""Where nobody measured, nothing is compared: whatever stands there, every error and every verdict is the same."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.noisy_trials import WEIGHTS
from tests.support.swings import FRAMES, LIKE, MARKERS, TIME, TIP, experiment, swing, trial
from trunkline.identification.diagnostics.trial_diagnostics import exchanged_labels, moving_start, started_off
from trunkline.identification.evaluation.baselines import hanging_still
from trunkline.identification.evaluation.error_tables import marker_table, trial_table
from trunkline.identification.evaluation.evaluation import Prediction, errors_of, scores
from trunkline.identification.evaluation.repeatability import end_shape
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.identify import _few
from trunkline.identification.results.scoring import fingerprint
from trunkline.identification.simulate.loss import (
    LOSSES,
    internal_error,
    loss_of,
    position_error,
    velocity_error,
)

FIT = Fit(MARKERS, {}, (), "positions", WEIGHTS, None)  # type: ignore[arg-type]
SIMULATED = swing(0.04, 3.5, 12.3)


def hidden(rows: slice, markers: slice) -> np.ndarray:
    measured = np.ones((FRAMES, 3), bool)
    measured[rows, markers] = False
    return measured


HIDDEN = {
    "a marker for a while": hidden(slice(20, 60), slice(1, 2)),
    "the tip for a while": hidden(slice(10, 45), slice(TIP, TIP + 1)),
    "all for a while": hidden(slice(30, 40), slice(None)),
    "a marker never": hidden(slice(None), slice(0, 1)),
    "the tip at the end": hidden(slice(-20, None), slice(TIP, TIP + 1)),
    "the first frames": hidden(slice(0, 12), slice(None)),
    "here and there": np.random.default_rng(1).random((FRAMES, 3)) > 0.3,
}


def of_trial(positions, measured):
    row = errors_of(SIMULATED, experiment(positions, measured), LIKE, "positions", WEIGHTS)
    assert {"e_internal_mm", "e_position_mm", "e_tip_mm", "e_velocity_mm_s", "loss"} <= set(row)
    return [row[name] for name in sorted(row)]


def of_path(positions, measured):
    path = experiment(positions, measured, "static_path", frame_step=0.0)
    row = scores(replace(LIKE, positions=[SIMULATED]), [path], "distances", WEIGHTS)["identify"]
    assert {"e_tip_rms_mm", "e_tip_centred_rms_mm", "loss"} <= set(row)
    return [row[name] for name in sorted(row) if name != "by_experiment"]


def table(make):
    def compute(positions, measured):
        prediction = Prediction(replace(LIKE, positions=[SIMULATED]), [experiment(positions, measured)])
        return make({"model": prediction}).select_dtypes("number").to_numpy()

    return compute


def last_shape(kind: str):
    def compute(positions, measured):
        ended = [experiment(positions, measured, kind)]
        return hanging_still(ended, LIKE, ended).positions[0][0]

    return compute


def sentence(judge):
    def compute(positions, measured):
        return judge(SIMULATED, experiment(positions, measured), FIT)

    return compute


def exchanged(positions, measured):
    """As if the labels of the second marker and the tip were exchanged."""
    order = [0, 2, 1]
    return exchanged_labels(SIMULATED, experiment(positions[:, order], measured[:, order]), FIT)


def late(positions, measured):
    """As if it began a quarter of a second later."""
    return started_off(np.concatenate([SIMULATED[25:], SIMULATED[:25]]), experiment(positions, measured), FIT)


def swaying(positions, measured):
    """As if a hand still swung the arm when it let go, in frame 40."""
    swayed = positions + 0.3 * TIME[:, None, None] * np.array([0.0, 1.0, 0.0])  # m, at 0.3 m/s
    return moving_start(trial(swayed, measured, start=0.4), experiment(swayed[41:], measured[41:]))


def widest(positions, measured):
    """Which of three trials swings farthest."""
    widths = [(swing(0.02), None, "narrow"), (positions, measured, "partly measured"), (swing(0.08), None, "wide")]
    return [e.name for e in _few([experiment(p, mask, name=name) for p, mask, name in widths], 3)]


# by what they give, from positions (T, S, 3) and where they were measured (T, S)
COMPARED = {
    "E_internal": lambda p, mask: internal_error(SIMULATED, p, mask),
    "the position error": lambda p, mask: position_error(SIMULATED, p, mask),
    "the velocity error": lambda p, mask: velocity_error(SIMULATED, p, mask, 100.0),
    "the loss of distances": lambda p, mask: loss_of(LOSSES["distances"](SIMULATED[None], p, mask, WEIGHTS)),
    "the loss of positions": lambda p, mask: loss_of(LOSSES["positions"](SIMULATED[None], p, mask, WEIGHTS)),
    "the errors of a swing": of_trial,
    "the errors of a path": of_path,
    "the table of trials": table(trial_table),
    "the table along the arm": table(lambda predictions: marker_table(predictions, MARKERS)),
    "the null model of a swing": last_shape("release"),
    "the null model of a path": last_shape("static_path"),
    "where a trial ends": lambda p, mask: np.array(end_shape(trial(p, mask)), dtype=float),
    "what tells a trial from another": lambda p, mask: fingerprint(trial(p, mask)),
    "whether it starts otherwise": sentence(started_off),
    "whether labels are exchanged": sentence(exchanged_labels),
    "whether a hand moves it": swaying,
    "which trial swings widest": widest,
    "that it starts otherwise": late,
    "that labels are exchanged": exchanged,
}


@pytest.mark.filterwarnings("ignore:Mean of empty slice")
@pytest.mark.parametrize("measured", HIDDEN.values(), ids=HIDDEN)
@pytest.mark.parametrize("compared", COMPARED.values(), ids=COMPARED)
@pytest.mark.parametrize("filler", [-40.0, np.nan])
def test_what_nobody_measured_counts_nowhere(compared, measured, filler):
    real = swing()
    expected = compared(real, measured)
    filled = np.where(measured[..., None], real, filler)
    if compared in (late, exchanged) and measured is HIDDEN["the first frames"]:
        assert expected
    if isinstance(expected, str | list) and compared not in (of_trial, of_path):
        assert compared(filled, measured) == expected
    else:
        np.testing.assert_allclose(compared(filled, measured), expected, rtol=1e-9)


MEASURES = {
    "E_internal": lambda s, p, mask: internal_error(s, p, mask),
    "position": lambda s, p, mask: position_error(s, p, mask),
    "velocity": lambda s, p, mask: velocity_error(s, p, mask, 1.0),
}


@pytest.mark.parametrize(
    ("name", "expected"), [("E_internal", (1 + 2 + 6) / 3), ("position", (1 + 2 + 6) / 3), ("velocity", 1.0)]
)
def test_each_error_is_the_mean_over_what_was_measured(name, expected):
    """By hand: of two markers in three frames, those samples are off by 50 m that were not measured."""
    real = np.zeros((3, 2, 3))
    real[..., 2] = -100.0
    off = np.array([[1.0, 50.0], [2.0, 50.0], [50.0, 6.0]])
    measured = np.array([[True, False], [True, False], [False, True]])
    simulated = real - np.stack([0 * off, 0 * off, off], axis=-1)
    assert MEASURES[name](simulated, real, measured) == pytest.approx(expected)
    assert MEASURES[name](np.stack([simulated, real]), real, measured).tolist() == pytest.approx([expected, 0.0])


def test_a_tip_that_nobody_saw_has_no_error():
    row = errors_of(SIMULATED, experiment(swing(), hidden(slice(None), slice(TIP, TIP + 1))), LIKE, None, None)
    assert {name for name in row if "tip" in name or "swing" in name or "late" in name} == set()
    assert row["e_position_mm"] > 0
