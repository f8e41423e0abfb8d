"""Variants: each changes what it names and nothing else, and a model answers without a network."""

from dataclasses import fields, replace

import numpy as np
import pytest

from rehearsal import settings
from rehearsal.experiments.ablations import SURE, VARIANTS, _cad_grasp, varied
from rehearsal.experiments.bench import SharedRun
from rehearsal.experiments.lookup import lookup, tensions_of
from tests.rehearsal.arm import settings as stand_in
from tests.rehearsal.arm import stranger
from tests.support.bent_chain import hardening_stump, stump_spec
from tests.support.operator import config
from tests.support.twins import posterior_about
from trunkline.ar.hybrid.friction import TPU_ON
from trunkline.ar.hybrid.tip_uncertainty import BaseAlignment
from trunkline.ar.hybrid.uncertainty import Contact, GraspUncertainty, sample
from trunkline.ar.preview.package import Package
from trunkline.ar.preview.preview_twin import RobotModel
from trunkline.ar.teleop.alignment import Aligned, align, wrist_of
from trunkline.ar.teleop.tendons import bend
from trunkline.ar.teleop.vectors import DOWN
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.kinematics.panda.mounts import PandaRobot
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import equilibrium

FRICTION, PLACE = 0.2, (0.005, 0.005, 0.005)
READY = (0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785)
MODELS = ("statics", "cad")  # that need a package, and a drawing of the arm


@pytest.fixture(scope="module")
def bench() -> SharedRun:
    robot = PandaRobot("panda", 0.05, 0.8, 0.0, list(READY))
    posterior = posterior_about(stump_spec().compile(), {"kp": 1.0})
    uncertainty = GraspUncertainty(Contact(FRICTION, PLACE, 0.1), posterior)
    world_model = RobotModel(stump_spec(), uncertainty, robot, BaseAlignment(0.0, 0.0))
    person, free = settings.person(), settings.free()
    return SharedRun(None, config(), stranger(), stand_in(), person, free, world_model=world_model)  # type: ignore[arg-type]


def changed(variant: SharedRun, bench: SharedRun) -> list[str]:
    return [field.name for field in fields(SharedRun) if getattr(variant, field.name) is not getattr(bench, field.name)
            and getattr(variant, field.name) != getattr(bench, field.name)]  # fmt: skip


@pytest.mark.parametrize(
    ("experiment", "name"),
    [(which, name) for which in ("reach", "follow") for name in VARIANTS[which] if name not in MODELS],
)
def test_a_variant_changes_one_thing(bench, experiment, name):
    same = name == f"delay_{config().core.follow_delay:g}s"
    assert len(changed(varied(bench, experiment, name), bench)) == (0 if same else 1)


@pytest.mark.parametrize("name", [name for name in VARIANTS["grasp"] if name not in (*MODELS, "single")])
def test_a_variant_of_a_grasp_changes_one_thing_more_than_what_it_compares_with(bench, name):
    beside = bench if name in ("no_preview", "slippery") else varied(bench, "grasp", "single")
    ablated = varied(bench, "grasp", name)
    assert len(changed(ablated, beside)) == 1


@pytest.mark.parametrize(("experiment", "name"), [("reach", "delay_1s"), ("follow", "no_preview")])
def test_a_variant_of_another_experiment_is_refused_with_those_there_are(bench, experiment, name):
    with pytest.raises(InputError, match=f"'{name}', expected one of {experiment}: statics, cad"):
        varied(bench, experiment, name)


def test_a_single_preview_is_of_what_is_believed(bench):
    ablated = varied(bench, "grasp", "single")
    draws = sample(ablated.world_model.uncertainty, ablated.world_model.arm.compile(), ablated.previewing.futures, 0)
    assert (len(draws), draws.values) == (1, {})
    assert (draws.friction[0], *draws.offsets[0], draws.turns[0]) == (1.0, 0.0, 0.0, 0.0, 0.0)
    assert np.ptp(sample(bench.world_model.uncertainty, bench.world_model.arm.compile(), 8, 0).friction) > 0


def test_without_a_preview_no_grasp_is_foreseen(bench):
    assert not varied(bench, "grasp", "no_preview").judged


def test_the_drawings_arm_takes_the_identified_ones_place(bench, tmp_path):
    drawing, other = tmp_path / "arm.xml", stump_spec(5)
    other.compile()
    other.to_file(str(drawing))
    package = Package("", None, None, None, None, None, np.zeros(3), 0.0, None, {})  # type: ignore[arg-type]
    ablated = _cad_grasp(replace(bench, package=package), drawing)
    assert ablated.world_model.arm.compile().nv == ablated.package.model.nv == ablated.package.chain.units * 2 == 10
    assert ablated.package.geometry.units == 5
    assert ablated.world_model.robot == bench.world_model.robot
    assert ablated.world_model.uncertainty == SURE


def test_a_slippery_robot_is_so_by_what_is_believed(bench):
    ablated = varied(bench, "grasp", "slippery")
    assert ablated.stand_in.touch.arm_object == pytest.approx(0.7 * TPU_ON[bench.previewing.material])
    assert ablated.stand_in.touch.arm_world == bench.stand_in.touch.arm_world


def test_without_bending_planes_the_wrist_does_not_turn_for_the_tip(bench):
    wrist, mount, tip = wrist_of(READY, 0.05), (0.5, 0.0, 0.5), (0.5, 0.1, 0.1)
    plain, without = (
        align(tip, mount, DOWN, wrist, Aligned(0.0, 0, 0.0), flown.config.core.bending_plane)
        for flown in (bench, varied(bench, "follow", "no_plane"))
    )
    assert abs(plain.heading) > 0.5
    assert without == Aligned(0.0, 0, 0.0)


def test_a_bases_error_is_the_size_that_its_name_says(bench):
    assert varied(bench, "follow", "base_20mm").stand_in.sensors.alignment_mm == 20.0
    assert varied(bench, "follow", "base_4deg").stand_in.sensors.alignment_deg == 4.0
    assert replace(varied(bench, "follow", "base_4deg").stand_in.sensors, alignment_deg=0.5) == bench.stand_in.sensors


def test_a_table_of_equilibria_answers_for_a_model_that_no_network_knows():
    chain, down = read_chain(hardening_stump()), downwards(0.6, 1.0)
    tensions = np.zeros((1, chain.tendons))
    tensions[0, :2] = 0.37 * chain.max_tension[:2]
    x, y, z = (float(v) for v in equilibrium(chain, tensions, STANDARD_GRAVITY * down).position[0])
    gravity = tuple(map(float, down))
    first = bend(lookup(chain), (x, y, z), gravity, chain.length)
    assert 1e-4 < np.linalg.norm(first.tip - (x, y, z)) < 0.1 * chain.length
    np.testing.assert_allclose(bend(lookup(chain), (x, y, z), gravity, 0.01, chain).tip, (x, y, z), atol=1e-4)


def test_no_more_than_two_tendons_of_the_table_are_taut():
    tensions = tensions_of(read_chain(hardening_stump()))
    assert (np.count_nonzero(tensions, axis=1) <= 2).all()
    assert len(np.unique(tensions, axis=0)) == len(tensions)
