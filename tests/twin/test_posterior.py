"""The one distribution of an arm's parameters: of what the tables state, cut where their intervals are."""

import re

import numpy as np
import pytest
from scipy.stats import t as student

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.twin.posterior import Posterior


def table(**rows) -> dict:
    """A stage's parameters.json. rows: value, half width, and range."""
    parameters = {
        name: {"value": value, "interval_95_given_model": [value - half, value + half], "range": list(span)}
        for name, (value, half, span) in rows.items()
    }
    correlation = {a: {b: 1.0 if a == b else 0.5 for b in rows} for a in rows}
    return {"parameters": parameters, "correlation": correlation, "fitted_to": dict.fromkeys("abcde")}


def test_intervals_become_standard_uncertainties_and_later_stages_win():
    wide = {"mount_tilt_x": (0.01, 0.002, (-0.1, 0.1)), "mount_tilt_y": (0.0, 0.003, (-0.1, 0.1))}
    first, second = table(**wide), table(mount_tilt_y=(0.02, 0.001, (-0.1, 0.1)))
    merged = Posterior.from_tables({"one": first, "two": second})
    assert merged.names == ["mount_tilt_x", "mount_tilt_y"]
    assert merged.stages == ["one", "two"]
    scale, factor = PARAMETERS["mount_tilt_x"].scale, student(4).ppf(0.975)
    np.testing.assert_allclose(merged.deviation, np.array([0.002, 0.001]) / scale / factor)
    np.testing.assert_array_equal(merged.correlation, np.eye(2))
    alone = Posterior.from_tables({"one": first})
    assert alone.correlation[0, 1] == 0.5
    x, y = alone.sample(40_000, 10).values()
    assert np.corrcoef(x, y)[0, 1] == pytest.approx(0.5, abs=0.05)
    assert np.quantile(x, [0.025, 0.975]) == pytest.approx([0.008, 0.012], abs=2e-4), "95 % lie in the interval"
    assert alone.interval("mount_tilt_x") == pytest.approx((0.008, 0.012))


def test_it_is_of_the_intervals_given_the_model_whatever_is_considered():
    """What the model fixes moves all parameters together; drawn of each alone, it would count twice."""
    narrow = table(mount_tilt_x=(0.01, 0.002, (-0.1, 0.1)))
    narrow["parameters"]["mount_tilt_x"]["interval_95"] = [-0.01, 0.03]
    assert Posterior.from_tables({"one": narrow}).interval("mount_tilt_x") == pytest.approx((0.008, 0.012))


def test_the_interval_of_the_draws_is_the_stated_one_where_the_range_cuts_it():
    """The longer side is the half width, and what lies beyond the range counts as at its end."""
    cut = table(mount_tilt_x=(0.01, 0.002, (-0.1, 0.1)))
    cut["parameters"]["mount_tilt_x"] |= {"interval_95_given_model": [0.008, 0.0105], "range": [-0.1, 0.0105]}
    posterior = Posterior.from_tables({"one": cut})
    assert posterior.interval("mount_tilt_x") == pytest.approx((0.008, 0.0105))
    drawn = posterior.sample(40_000, 11)["mount_tilt_x"]
    assert np.quantile(drawn, [0.025, 0.975]) == pytest.approx([0.008, 0.0105], abs=2e-4)
    assert drawn.max() == 0.0105


@pytest.mark.filterwarnings("error")
def test_the_far_draws_of_few_trials_are_cut_and_no_warning():
    """With 1 degree of freedom a logarithm may be drawn beyond what a float's exponential holds."""
    two = table(kp=(1000.0, 900.0, (10.0, 1e5))) | {"fitted_to": dict.fromkeys("ab")}
    drawn = Posterior.from_tables({"identify_control": two}).sample(100_000, 0)["kp"]
    assert (drawn.min(), drawn.max()) == (10.0, 1e5)
    assert np.quantile(drawn, 0.025) == pytest.approx(100.0, rel=0.1)


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        ({"parameters": {"kp_ratio": {}}}, "parameters: found 'kp_ratio', expected the name of a parameter, did"),
        ({"parameters": {"kp": {"interval_95_given_model": [None, None]}}}, "expected two numbers that rise"),
        ({"parameters": {"kp": {}}}, "identify_control/parameters.json: kp: found no 'interval_95_given_model'"),
    ],
)
def test_what_is_no_table_is_one_line(broken, message):
    with pytest.raises(InputError, match=re.escape(message)):
        Posterior.from_tables({"identify_control": broken})
