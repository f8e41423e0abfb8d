"""What is scored of a reach is what a page tells of it."""

import numpy as np

from tests.ar.session.test_preview_process import made, order
from trunkline.ar.session.preview_process import PredictionAnswer, prediction_message


def test_a_reach_is_foreseen_as_on_a_page():
    """The same plan in the same world with the same seed: the same circle about the tip's end, to the last digit."""
    page, asked = made(), order(7)
    plan = page.planner.plan(asked.request, asked.world, asked.joints, asked.commands)
    foreseen = page.foresight.reach(plan, asked.world, asked.request.serial)
    (reply,) = [answer.foreseen for answer in page.answers(asked) if isinstance(answer, PredictionAnswer)]
    assert prediction_message(plan.digest(), foreseen) == reply
    stated = foreseen.preview.stated
    assert stated.radii[-1] == reply.spread[-1]
    np.testing.assert_array_equal(stated.tips[-1], reply.tip[-1])
    assert stated.times[-1] > plan.duration
