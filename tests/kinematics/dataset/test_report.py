"""What is said about the data set: a comparison that blew up is not passed over."""

import numpy as np
import pandas as pd
import pytest

from trunkline.errors import InputError
from trunkline.kinematics.dataset.report import spread
from trunkline.pipeline.stage import write_json


def test_a_spread_by_hand():
    assert spread(pd.Series([3.0, 1.0, 2.0]), skipna=False) == {"median": 2.0, "p95": pytest.approx(2.9), "max": 3.0}


def test_one_sample_without_a_deviation_leaves_no_spread_to_write(tmp_path):
    spread_of_all = spread(pd.Series([1.0, np.nan, 2.0]), skipna=False)
    assert np.isnan(list(spread_of_all.values())).all()
    with pytest.raises(InputError, match=r"metrics.json: mujoco_deviation_mm\.max: found nan"):
        write_json(tmp_path / "metrics.json", {"mujoco_deviation_mm": {"max": spread_of_all["max"]}})


def test_a_band_that_was_not_found_is_left_out():
    """It is counted beside the spread, as friction_band_found; with none there is nothing to write."""
    assert spread(pd.Series([1.0, np.nan, 2.0]))["max"] == 2.0
    assert np.isnan(spread(pd.Series([np.nan, np.nan]))["max"])
