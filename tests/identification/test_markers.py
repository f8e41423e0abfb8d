"""Markers beside the arm's axis, and a mount that is not where its tracked body says."""

from dataclasses import replace

import numpy as np
import pytest

from tests.identification.test_recovery import identified
from tests.support.matched_plant import curl, markers_of, release, small_model, tilt
from tests.support.noisy_trials import with_values
from tests.support.small_arm import small_spec
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.markers import with_measured_markers


@pytest.fixture(scope="module")
def model():
    return small_model()


def sites(model) -> list[int]:
    return [model.site(f"{name}_center").id for name in markers_of(model)]


def trials(model) -> list:
    """Bent both ways and in both planes, as releases and hooks of a session are."""
    return [release(model, bend, frames=3) for bend in (0.3, -0.25, 0.2)] + [tilt(model, 60), tilt(model, 90)]


def test_markers_are_found_where_they_sit(model):
    off = model.__copy__()
    moved = np.random.default_rng(1).normal(0, 1e-3, (len(sites(model)), 3))
    off.site_pos[sites(model)] += moved
    marked = with_measured_markers(model, trials(off))
    np.testing.assert_allclose(marked.site_pos[sites(model)], off.site_pos[sites(model)], atol=2e-4)
    unseen = [prepare(release(off, 0.15, "validate", 3), m, 3).fit.residuals.mean() for m in (model, marked)]
    assert unseen[1] < 0.3 * unseen[0]


def test_a_marker_is_found_that_is_tracked_at_its_bodys_origin(model):
    """MuJoCo takes such a site's place from its body, whatever `site_pos` says, unless told otherwise."""
    at_origin = small_spec(6)
    at_origin.site("unit_03_center").pos = [0, 0, 0]
    at_origin = at_origin.compile()
    off, marker = model.__copy__(), model.site("unit_03_center").id
    off.site_pos[marker] = [1e-3, -1e-3, 0]
    marked = with_measured_markers(at_origin, trials(off))
    np.testing.assert_allclose(marked.site_pos[marker], off.site_pos[marker], atol=2e-4)
    residuals = prepare(release(off, 0.15, "validate", 3), marked, 3).fit.residuals
    assert residuals[markers_of(model).index("unit_03")] < 2e-4


def test_markers_on_their_axes_stay_there(model):
    """But for what the expectation of a smooth bend makes of these poses."""
    marked = with_measured_markers(model, trials(model))
    np.testing.assert_allclose(marked.site_pos, model.site_pos, atol=1e-4)


def test_only_trials_to_identify_from_tell_of_markers(model):
    off = model.__copy__()
    off.site_pos[sites(model)] += 1e-3
    hidden = [replace(trial, split="validate") for trial in trials(off)]
    marked, alone = (with_measured_markers(model, some) for some in (trials(model) + hidden, trials(model)))
    np.testing.assert_array_equal(marked.site_pos, alone.site_pos)


def test_a_tilted_mount_shows_in_shapes_at_rest(model):
    true = {"mount_tilt_x": 0.02, "mount_tilt_y": -0.03}
    truth = with_values(model, true)
    result = identified([tilt(truth, angle) for angle in (0, 45, 90)], model, dict.fromkeys(true, (-0.1, 0.1)))
    for name, value in true.items():
        assert result.values[name] == pytest.approx(value, abs=1e-4), name


def test_a_twisted_mount_shows_in_curls(model):
    truth = with_values(model, {"mount_twist": 0.05})
    trials = [curl(truth, level, frames=40, tendon=tendon) for tendon, level in enumerate((8, 6, 7))]
    result = identified(trials, model, {"mount_twist": (-0.1, 0.1)})
    assert result.values["mount_twist"] == pytest.approx(0.05, abs=1e-3)


def test_a_mount_turned_about_one_axis_stays_turned_about_the_others(model):
    twice = with_values(with_values(model, {"mount_tilt_x": 0.03}), {"mount_twist": 0.01})
    np.testing.assert_allclose(twice.body("base").quat[1:], [0.015, 0, 0.005], atol=1e-5)
