"""What the tables of the judges leave open: the settings by number, heights that do not begin at 0, a single view."""

import numpy as np
import pytest

from rehearsal.experiments.follow import failure as not_followed
from rehearsal.experiments.grasp import failure
from rehearsal.experiments.handle import why_not
from rehearsal.experiments.stated import scores
from rehearsal.operator.scripts import Ending
from tests.rehearsal.frames import frame
from tests.rehearsal.test_follow import BEGUN, LONGEST, NEVER, SECONDS, path, views
from tests.rehearsal.test_held import DONE, HOLD, MASS, SCENE, STAYED, S, borne, handed
from tests.rehearsal.test_stated import NAN, reach
from trunkline.frames import STANDARD_GRAVITY


@pytest.mark.parametrize("ground", [-0.4, 0.0, 0.7])
@pytest.mark.parametrize(("lifted", "cause"), [(1e-3, ""), (-1e-3, "slip: it was lifted by")])
def test_a_thing_is_lifted_from_where_it_was(ground, lifted, cause):
    places = [(0.0, 0.0, ground), *[(0.0, 0.0, ground + S.lifted + lifted)] * 2]
    frames = [frame(float(now), "aim" if now else "execute", HOLD, place=place) for now, place in enumerate(places)]
    assert failure(DONE, frames, S).startswith(cause)
    assert bool(failure(DONE, frames, S)) == bool(cause)


@pytest.mark.parametrize(("share", "speed", "cause"), [
    (0.51, 0.029, ""),
    (0.49, 0.029, STAYED),
    (0.51, 0.031, STAYED),
])  # fmt: skip
def test_at_rest_on_the_table_is_half_the_weight_and_3_cm_in_a_second(share, speed, cause):
    frames = handed(borne(share * MASS * STANDARD_GRAVITY), speed=(speed, 0.0, 0.0))
    assert why_not(DONE, frames, SCENE, S) == cause


@pytest.mark.parametrize(("now", "cause"), [
    (BEGUN, ""), (BEGUN + SECONDS, ""), (BEGUN - 0.25, NEVER), (BEGUN + SECONDS + 0.25, NEVER),
])  # fmt: skip
def test_a_path_that_anybody_saw_was_begun(now, cause):
    shown = [view for view in views() if view.now == now]
    assert len(shown) == 1
    assert not_followed(Ending(True), shown, [], path(), LONGEST) == cause


def test_radii_are_of_the_runs_for_which_one_was_stated():
    metrics = scores([reach(2.0, 1.0), reach(NAN, 0.0), reach(4.0, 5.0)])
    assert metrics["radius_mm"] == {"median": 3.0, "p95": pytest.approx(3.9)}
    assert metrics["coverage"]["at_end"]["inside"] == 1
    assert metrics["tip_error_radii"]["at_end"]["median"] == np.median([0.5, 1.25])
