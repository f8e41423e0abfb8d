"""What contact settings must do: hold. Two units squeeze an object with a known force; friction alone carries it."""

import mujoco
import numpy as np
import pytest

from trunkline.ar.hybrid.friction import CONDIM, SOLIMP, SOLREF, TPU_ON, coefficients, make_holding
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.frames import STANDARD_GRAVITY
from trunkline.model.arm.contact_geometry import ARM, WORLD, unit_corners

STEP = 1 / 480  # s
SQUEEZE = 8.0  # N, from each side
WIDTH = 0.06  # m
SECONDS = 10.0


def squeezed(chain, shape, mass):
    """Heights of the object's centre, m, and its mechanical energy, J, at every step."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0, 0, -STANDARD_GRAVITY]
    make_holding(spec)
    unit = 8
    mesh = spec.add_mesh(name="unit")
    mesh.uservert = unit_corners(chain, unit).ravel()
    widest = (np.linalg.norm(unit_corners(chain, unit)[:, :2], axis=1)).max()
    for side in (-1, 1):
        name = f"jaw_{side + 1}"
        jaw = spec.worldbody.add_body(name=name, pos=[side * (WIDTH / 2 + widest), 0, chain.lengths[unit] / 2])
        jaw.explicitinertial, jaw.mass, jaw.ipos, jaw.inertia = True, 0.05, [0, 0, 0], [1e-5] * 3
        jaw.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[-side, 0, 0], damping=[5.0, 0, 0])
        jaw.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="unit", mass=0, contype=ARM, conaffinity=WORLD,
                     condim=CONDIM, friction=coefficients("plastic"), solref=SOLREF, solimp=SOLIMP)  # fmt: skip
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
    GraspObject(shape, WIDTH, 0.12, mass, "plastic").add_to(spec, np.zeros(3))
    model = spec.compile()
    data, number = mujoco.MjData(model), model.body("object").id
    data.ctrl[:] = SQUEEZE
    height, energy = [], []
    for _ in range(round(SECONDS / STEP)):
        mujoco.mj_step(model, data)
        speed = data.joint("object").qvel
        height.append(data.joint("object").qpos[2])
        kinetic = mass * speed[:3] @ speed[:3] / 2 + model.body_inertia[number] @ speed[3:] ** 2 / 2
        energy.append(kinetic + mass * STANDARD_GRAVITY * height[-1])
    return np.array(height), np.array(energy)


@pytest.mark.parametrize("shape", ["cylinder", "box", "sphere", "toy"])
def test_what_is_held_neither_creeps_nor_gains_energy(chain, shape):
    strongest = 2 * TPU_ON["plastic"] * SQUEEZE / STANDARD_GRAVITY  # kg that friction can carry
    height, energy = squeezed(chain, shape, 0.6 * strongest)
    assert abs(height[-1] - height[round(0.5 / STEP)]) < 1e-3
    assert abs(height[-1]) < 3e-3
    assert energy.max() < 1e-3 * 0.6 * strongest * STANDARD_GRAVITY  # at most what a rise of 1 mm holds
    rises = energy - np.minimum.accumulate(energy)
    assert rises[round(0.5 / STEP) :].max() < 1e-6


def test_friction_ends_where_coulomb_says(chain):
    """A tenth less than what friction can carry is held, a tenth more falls."""
    strongest = 2 * TPU_ON["plastic"] * SQUEEZE / STANDARD_GRAVITY
    assert abs(squeezed(chain, "box", 0.9 * strongest)[0][-1]) < 5e-3
    assert squeezed(chain, "box", 1.1 * strongest)[0][-1] < -1
