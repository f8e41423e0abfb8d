"""One model made of parts: a robot, the calibrated arm on its mount, a world and an object.

The arm is attached as identified: its bodies, hinges, springs, tendons, motors and numbers keep their names, so that
what steps it (`trunkline/model/simulation/`) finds its capstan friction, winches and branches. Joints' branches, which
hang on the world in the arm's own file, hang on the mount here; they weigh nothing.

MuJoCo keeps the options of what is attached to, so they are set to the arm's before: time step, integrator and gravity,
which points down in the world here however the arm's file had it. Cones and `impratio` are those of
`trunkline/ar/hybrid/friction.py`. What else MuJoCo warns of is that names without prefix may clash: a test saves and
reads the model back.

The turn of the arm's body `base` in its file is that of the tracked marker against the arm, and none of the mount's.
"""

import warnings
from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.ar.hybrid.friction import SOLIMP, SOLREF, coefficients, make_holding
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.worlds import WorldGeometry
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.panda.maker_model import JOINTS
from trunkline.kinematics.panda.mounts import Robot
from trunkline.model.arm.contact_geometry import add_touch

# It comes as often as such a spec is compiled or saved; nothing else in the parts is called as anything in the arm.
warnings.filterwarnings("ignore", message="Attaching a spec with an empty prefix", category=UserWarning)

ARM_MATERIAL = "plastic"  # what the arm's own friction is for: contacts with floor, tables and itself


@dataclass
class Placed:
    """An object and where it is: on a surface of the world, or hanging from the hook.

    Attributes:
        position: of its centre, m. Shape (3,).
        quaternion: w first.
        hanging: whether it hangs from the world's hook.
    """

    object: GraspObject
    position: np.ndarray
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    hanging: bool = False


def compose(
    arm: mujoco.MjSpec,
    robot: Robot,
    world: WorldGeometry | None = None,
    placed: Placed | None = None,
    touch: bool = True,
) -> mujoco.MjSpec:
    """The whole model. Compile it with `.compile()`.

    Args:
        arm: the calibrated arm's spec, which is left as it is.
        touch: whether units have geoms that touch.

    Raises:
        InputError: the arm has no body `base` or units of another form, or an object hangs in a world without hook.
    """
    if arm.body("base") is None:
        raise InputError("arm.xml: found no body 'base', expected the calibrated arm's mount")
    spec, arm = robot.build(), arm.copy()
    spec.modelname = "hybrid"
    spec.compiler.degree, spec.compiler.autolimits = False, False
    spec.option.timestep, spec.option.integrator = arm.option.timestep, arm.option.integrator
    spec.option.gravity = arm.option.gravity = [0, 0, -STANDARD_GRAVITY]
    make_holding(spec)
    make_holding(arm)
    base = arm.body("base")
    base.quat = [1, 0, 0, 0]
    base.mass, base.inertia = 0.0, [0, 0, 0]  # in its own file it stands still; `mount_mass` is what the Panda bears
    if touch:
        add_touch(arm, coefficients(ARM_MATERIAL), SOLREF, SOLIMP)
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)  # else it says so in MUJOCO_LOG.TXT as well
    try:
        spec.attach(arm, prefix="", frame=robot.mount(spec))
    finally:
        mujoco.set_mju_user_warning(before)
    if spec.body("link_7") is not None:  # the first unit bends beside the flange, closer than its hull
        for unit in ("unit_01", "unit_02"):
            spec.add_exclude(name=f"link_7_{unit}", bodyname1="link_7", bodyname2=unit)
    if world is not None:
        world.add_to(spec)
    if placed is not None:
        if placed.hanging and (world is None or world.hook is None):
            raise InputError("world.hook: found none, expected one for an object that hangs")
        placed.object.add_to(
            spec, np.asarray(placed.position, dtype=float), placed.quaternion, "hook_end" if placed.hanging else None
        )
    return spec


def panda_joints(model: mujoco.MjModel) -> np.ndarray:
    """Numbers of the Panda's joints in a composed model. Shape (7,), or (0,) on a fixed mount."""
    numbers = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in JOINTS]
    return np.array([number for number in numbers if number >= 0], dtype=int)
