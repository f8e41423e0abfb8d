"""The study of snap-through: a soft arm buckles, a stiff one does not, and either is told in words."""

import numpy as np
import pytest

from studies.snap_through import Branches, alike, search, ventral_pull, within_force
from tests.support.small_arm import small_spec
from trunkline.model.statics.chain import read_chain


@pytest.fixture(params=[1.0, 0.03], ids=["stiff", "soft"])
def stiffness(request):
    return request.param


def chain_of(stiffness):
    model = small_spec(8).compile()
    model.jnt_stiffness[:] *= stiffness
    return read_chain(model)


def test_a_soft_arm_leans_to_either_side_where_a_stiff_one_stays_in_its_plane(stiffness):
    found = ventral_pull(chain_of(stiffness), 0.0)
    if stiffness == 1.0:
        assert np.abs(found.aside).max() < 1e-6
        assert alike(found).startswith("one shape up to ")
        assert "several" not in alike(found)
    else:
        assert found.aside.min() == pytest.approx(-found.aside.max(), rel=1e-3)
        assert found.apart.max() == pytest.approx(2 * found.aside.max(), rel=0.02)
        assert f"tips up to {1e3 * found.apart.max():.0f} mm apart" in alike(found)


def test_lengths_that_no_motor_holds_are_none():
    chain = chain_of(1.0)
    far = chain.straight_lengths[None] - 0.5 * chain.length
    found = search(chain, far, np.array([[0, 0, -9.81]]), np.zeros((1, 16)), 2, np.random.default_rng(0))
    assert within_force(found) == "  0.0% within the motors' force"


def test_what_was_found_is_told():
    found = Branches(np.array([True, True, False, True]), np.array([1, 2, 0, 3]), np.array([0, 0.01, 0, 0.03]))
    assert within_force(found) == (
        " 75.0% within the motors' force, of these 66.67% with more than one equilibrium, "
        "tips 20 mm apart (median), 30 mm at most"
    )
