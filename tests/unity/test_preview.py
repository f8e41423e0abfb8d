"""What a preview needs, from the package alone: the arm moves as the identified one, free and in a grasp, and futures
are drawn from the same doubts."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.ar.hybrid.conftest import rubbing_arm
from tests.support.folders import package
from tests.unity.test_assemble import LABEL, PARAMETERS, ROBOT, sources_in
from trunkline.ar.hybrid.compose import Placed, compose
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.outcomes import Holding
from trunkline.ar.hybrid.rollout_batch import joined, preview
from trunkline.ar.hybrid.rollouts import CommandTrajectory, ComposedTwin, rollouts
from trunkline.ar.hybrid.uncertainty import GraspUncertainty, nominal_sample
from trunkline.ar.hybrid.worlds import WorldGeometry
from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import FixedMount
from trunkline.model.arm.contact_geometry import read_geometry
from trunkline.model.arm.spiral import spiral_chain
from trunkline.model.arm_model import ArmModel
from trunkline.twin.package import MANIFEST, arm_of, package_digest, read_package, robot_of
from trunkline.twin.posterior import Posterior
from trunkline.twin.twin import Twin
from trunkline.unity.assemble import Trajectory, assemble
from trunkline.unity.upm_package import CALIBRATED, MODEL, write_tarball

SECONDS, LET_GO, PULL, CURL = 0.6, 0.25, 0.02, Trajectory(0.2, 0.02, [0.0])


@pytest.fixture(scope="module")
def mjcf() -> str:
    """Of a short arm with all that Unity's importer has no component for but backlash."""
    spec = rubbing_arm(spiral_chain(0.2, 0.05, 0.02, 6), 3)
    spec.compile()
    return spec.to_xml()


@pytest.fixture(scope="module")
def files(mjcf, tmp_path_factory) -> dict[str, bytes]:
    """As a client reads them."""
    folder = tmp_path_factory.mktemp("preview")
    made, _ = assemble(LABEL, replace(sources_in(folder), mjcf=mjcf), CURL, ROBOT)
    write_tarball(folder / "twin.tgz", made)
    return read_package(folder / "twin.tgz")


def way_of(arm: mujoco.MjModel, joints=(), seconds: float = SECONDS) -> CommandTrajectory:
    """Tendon 1 is drawn in, the others are paid out."""
    time = 0.01 * np.arange(round(seconds / 0.01) + 1)
    straight = arm.tendon_length0[arm.actuator_trnid[:, 0]]
    drawn = np.clip(time / 0.3, 0, 1)[:, None] * np.array([-PULL, PULL, PULL])
    return CommandTrajectory(0.01, np.tile(np.array(joints, dtype=float), (len(time), 1)), straight + drawn, LET_GO)


def free(spec: mujoco.MjSpec) -> ComposedTwin:
    return ComposedTwin(compose(spec, FixedMount("fixed")).compile(), spec.compile())


def grasping(spec: mujoco.MjSpec) -> ComposedTwin:
    """A cylinder that hangs beside the arm, two thirds down, until it is let go."""
    geometry = read_geometry(spec)
    x, z = 0.6 * geometry.widths[0] + 0.01, -0.7 * geometry.length
    level = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
    placed = Placed(GraspObject("cylinder", 0.03, 0.1, 0.02, "plastic"), np.array([x, 0.0, z]), level, True)
    world = WorldGeometry(None, {}, [x, 0.0, z + 0.15])
    return ComposedTwin(compose(spec, FixedMount("fixed"), world, placed).compile(), spec.compile())


def moved(twin: ComposedTwin) -> np.ndarray:
    return joined(list(rollouts(twin, way_of(twin.arm), nominal_sample()))).qpos


@pytest.mark.parametrize("scene", [free, grasping])
def test_the_arm_of_the_package_moves_as_the_identified_one_to_the_bit(files, mjcf, scene):
    expected = moved(scene(mujoco.MjSpec.from_string(mjcf)))
    np.testing.assert_array_equal(moved(scene(arm_of(files))), expected)
    assert np.ptp(expected[0, :, 0]) > 0 or np.ptp(expected[0, :, 1]) > 0
    assert np.abs(moved(scene(mujoco.MjSpec.from_string(files[MODEL].decode()))) - expected).max() > 1e-3


def test_the_grasped_object_is_touched(mjcf):
    """Else the grasp above would be another free motion."""
    spec = mujoco.MjSpec.from_string(mjcf)
    touched, alone = moved(grasping(spec)), moved(free(spec))
    assert np.abs(touched[:, :, : alone.shape[2]] - alone).max() > 1e-2


def test_a_preview_needs_the_package_alone(files):
    assert package_digest(files)
    arm, robot = arm_of(files), robot_of(files)
    assert ArmModel(arm.compile()).capstan_friction > 0
    assert robot == ROBOT
    twin = ComposedTwin(compose(arm, robot).compile(), arm.compile())
    uncertainty = GraspUncertainty(posterior=Twin.of_package(files).posterior)
    result = preview(twin, way_of(twin.arm, robot.ready, 0.3), uncertainty, Holding(0.1), count=3)
    assert result.motion.sound.all()
    assert result.spread[-1] > 1e-4
    assert len(set(result.samples.values["kp"])) == 3


def test_the_posterior_of_the_package_is_that_of_the_stages(files):
    expected, posterior = Posterior.from_tables(PARAMETERS), Twin.of_package(files).posterior
    assert posterior.names == expected.names == ["stiffness", "kp", "damping"]
    np.testing.assert_array_equal(posterior.deviation, expected.deviation)
    np.testing.assert_array_equal(posterior.correlation, expected.correlation)
    assert posterior.interval("kp")[0] == pytest.approx(1800.0), "the latest stage's"


def test_a_package_without_them_is_one_line(files):
    manifest = json.loads(files[MANIFEST])
    del manifest["hybrid"]
    old = files | {MANIFEST: json.dumps(manifest).encode()}
    for read in (arm_of, Twin.of_package, robot_of):
        with pytest.raises(InputError, match=r"manifest\.json: found no block hybrid, expected"):
            read(old)


@pytest.fixture(scope="module")
def built() -> dict[str, bytes]:
    """The package that the stage made last."""
    return read_package(package())


@pytest.mark.parametrize("scene", [free, grasping])
def test_the_arm_of_the_package_that_was_built_moves_as_the_identified_one(built, scene):
    arm = package().parents[1] / "identify_control/arm.xml"
    identified = mujoco.MjSpec.from_file(str(arm))
    np.testing.assert_array_equal(moved(scene(arm_of(built))), moved(scene(identified)))
    assert built[CALIBRATED] == arm.read_bytes()


def test_a_preview_needs_the_package_that_was_built_alone(built):
    arm, robot = arm_of(built), robot_of(built)
    twin = ComposedTwin(compose(arm, robot).compile(), arm.compile()).stepped(1 / 240)
    uncertainty = GraspUncertainty(posterior=Twin.of_package(built).posterior)
    result = preview(twin, way_of(twin.arm, robot.ready, 0.4), uncertainty, count=3)
    assert result.motion.sound.all()
    assert result.spread[-1] > 1e-4
