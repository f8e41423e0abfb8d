"""Trials at rest by the statics: as MuJoCo settles, from either side of a winch's play, with what commands draw in."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.model.arm.test_sections import ACTUATION, SOLVER, arm
from tests.support.matched_plant import markers_of
from tests.support.small_arm import small_spec
from trunkline.frames import STANDARD_GRAVITY
from trunkline.identification.parameters.parameters import candidate_fields
from trunkline.identification.simulate.at_rest import shapes_at_rest
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.pose_fit import PoseFit
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm.tendons import Tendon
from trunkline.model.arm_model import PRELOAD, WINDING, ArmModel
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated
from trunkline.model.statics.restart import actuated_from

FOUR = [Tendon(angle, 0.012, end) for angle, end in ((0.0, 2), (120.0, 0), (-120.0, 0), (60.0, 0))]
DOWN = np.array([0.0, 0.0, -STANDARD_GRAVITY])


def made(**motors) -> mujoco.MjModel:
    return arm(tendons=FOUR).build(replace(ACTUATION, **motors), SOLVER, Path(".")).spec.compile()


def path_of(model: mujoco.MjModel, pulls: np.ndarray, kind: str = "static_path", **more) -> Experiment:
    """A trial whose every frame is at rest with these pulls (T, K), m."""
    frames, nothing = len(pulls), np.zeros(ArmModel(model).hinge_count)
    return Experiment(
        name="path", kind=kind, split="identify", gravity=DOWN, start=nothing, velocity=nothing, lead=0.0,
        controls=model.tendon_length0[ArmModel(model).cables] - pulls, positions=np.zeros((frames, 1, 3)),
        measured=np.ones((frames, 1), dtype=bool), frame_step=0.0, fit=PoseFit(nothing, np.zeros(1), 0, True), **more,
    )  # fmt: skip


def tips(model: mujoco.MjModel, experiment: Experiment, values: dict[str, float] | None = None) -> np.ndarray:
    fields = candidate_fields(model, {k: np.array([v]) for k, v in (values or {"kp": 2000.0}).items()})
    sites = ArmModel(model).marker_sites(("tip",))
    return shapes_at_rest(model, fields, [experiment], sites, None).positions[0][0, :, 0]


PULLS = np.random.default_rng(3).uniform(-0.002, 0.006, (5, 4))


@pytest.mark.parametrize("load", [0.0, 0.1])
def test_it_is_where_mujoco_settles(load):
    model = made()
    places = tips(model, path_of(model, PULLS, load=load))
    heavy = arm(tendons=FOUR, tip_load=load).build(ACTUATION, SOLVER, Path(".")).spec.compile()
    heavy.actuator_gainprm[:], heavy.actuator_biasprm[:] = model.actuator_gainprm, model.actuator_biasprm
    settled = settle(heavy, model.tendon_length0 - PULLS, DOWN)
    assert settled.rested.all()
    data = mujoco.MjData(heavy)
    for qpos, tip in zip(settled.qpos, places, strict=True):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(heavy, data)
        np.testing.assert_allclose(tip, data.site("tip_center").xpos, atol=1e-7)


def test_a_first_guess_leads_to_the_same_rest():
    model = made()
    chain = read_chain(model)
    commands = model.tendon_length0 - PULLS
    followed = actuated(chain, commands, DOWN)
    again = actuated_from(chain, followed.qpos + 0.01, commands, DOWN)
    assert again.converged.all()
    np.testing.assert_allclose(again.qpos, followed.qpos, atol=1e-7)
    np.testing.assert_allclose(again.tensions, followed.tensions, atol=1e-6)


def test_where_it_rests_depends_on_the_way_by_the_winch_s_play():
    play = 1e-3
    model = made(backlash=play)
    there_and_back = np.zeros((3, 4))
    there_and_back[:, 1] = 0.002, 0.006, 0.002
    places = tips(model, path_of(model, there_and_back), {"backlash": play})
    plain = made()
    behind = np.zeros((3, 4))  # after the first frame the cable trails by half the play, on either side
    behind[:, 1] = 0.002, 0.006 - play / 2, 0.002 + play / 2
    np.testing.assert_allclose(places, tips(plain, path_of(plain, behind)), atol=1e-9)


def test_commands_draw_in_what_the_model_says():
    model, other = made(), made()
    model.numeric_data[ArmModel(model).places(WINDING)] = 0.8
    model.numeric_data[ArmModel(model).places(PRELOAD)] = [0.001, 0.0, -0.0005, 0.0]
    places = tips(model, path_of(model, PULLS))
    drawn = 0.8 * PULLS + [0.001, 0.0, -0.0005, 0.0]
    np.testing.assert_allclose(places, tips(other, path_of(other, drawn)), atol=1e-9)
    as_searched = tips(other, path_of(other, PULLS), {"winding": 0.8, "preload_1": 0.001, "preload_3": -0.0005})
    np.testing.assert_allclose(places, as_searched, atol=1e-9)


def rubbing() -> mujoco.MjModel:
    """An arm with friction on its holes, three cables, and hinges that bend far."""
    spec = small_spec(6)
    add_holes(spec, GuideHoles(0.3, 2))
    return spec.compile()


def test_cables_rub_to_the_side_from_which_the_arm_came():
    """Drawn in, it bends less than in mid-band, and more where it was let come back; each as the statics have it."""
    model, pulls = rubbing(), np.array([[0.01, -0.3, -0.3]])
    fields = candidate_fields(model, {"capstan_friction": np.array([0.2])})
    sites = ArmModel(model).marker_sites(markers_of(model))
    chain = read_chain(model)
    bends = []
    for approach in (1, 0, -1):
        experiment = path_of(model, pulls, "static_pull", approach=approach)
        shape = shapes_at_rest(model, fields, [experiment], sites, None)
        followed = actuated(chain._replace(capstan=0.2 * approach), experiment.controls, DOWN)
        assert followed.converged.all()
        np.testing.assert_allclose(shape.angles[0], followed.qpos, atol=1e-6)
        bends.append(np.linalg.norm(shape.angles[0].reshape(-1, 2), axis=1).sum())
    assert bends[0] < bends[1] < bends[2]
