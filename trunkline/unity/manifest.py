"""manifest.json of the Unity package: all that an app must know and that the files do not say themselves."""

import hashlib
from typing import Literal

import mujoco
from pydantic import BaseModel, ConfigDict, Field

from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import Robot
from trunkline.model.arm_model import ArmModel
from trunkline.unity.frame import unity_position
from trunkline.unity.linearize import JointLaw, TendonLaw
from trunkline.unity.plugin import VERSION
from trunkline.unity.pulls import rest_lengths
from trunkline.unity.rounding import ROUNDED


class _Block(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Versions(_Block):
    package: str
    trunkline: str
    mujoco: str
    unity: str = Field(description="the oldest editor that it is meant for")
    unity_plugin: str = Field(default=VERSION, description="of org.mujoco, with the libmujoco of the same version")


class Units(_Block):
    length: Literal["m"] = "m"
    angle: Literal["rad"] = "rad"
    time: Literal["s"] = "s"
    mass: Literal["kg"] = "kg"
    force: Literal["N"] = "N"


class Frames(_Block):
    base: str = "right-handed; origin at the arm's mount, the straight arm along -z, tendon 1 over +x"
    unity: str = "left-handed, y up"
    position: str = "base (x, y, z) -> Unity (x, z, y)"
    quaternion: str = "base (w, x, y, z) -> Unity (x: x, y: z, z: y, w: -w)"
    gravity_angle: str = (
        "angle between the straight arm and gravity, the mount tilting about base +y; "
        "gravity in the base frame is g (sin, 0, -cos)"
    )
    meshes: str = "OBJ vertices are base (-x, z, y); Unity negates x on import, which leaves (x, z, y)"


class Names(_Block):
    bodies: list[str]
    joints: list[str]
    tendons: list[str]
    actuators: list[str]
    sites: list[str]


class Actuator(_Block):
    name: str
    tendon: str
    rest_length: float = Field(gt=0, description="m; the command that the control 0 stands for")


class BranchBlock(_Block):
    joint: str
    branch: str = Field(description="the hinge that lags behind the joint, on the world")
    tie: str = Field(description="the tendon that ties one to the other, whose spring bears nothing at rest")


class StepError(_Block):
    display_rate: float = Field(gt=0, description="Hz")
    steps_per_frame: int = Field(gt=0)
    step: float = Field(gt=0, description="s")
    tip_error_mm: float | None = Field(
        description="largest on a curl, against `time_step`, at the display's frames; null where the arm diverges"
    )


class Model(_Block):
    file: str
    time_step: float = Field(gt=0, description="s; with which the arm was calibrated")
    longest_step: float = Field(gt=0, description="s; the component takes no longer one")
    steps: list[StepError] = Field(description="by display rate, up to the steps a frame that the component takes")
    gravity: list[float] = Field(min_length=3, max_length=3, description="m/s², base frame, mount upright")
    gravity_unity: list[float] = Field(min_length=3, max_length=3, description="m/s², for Physics.gravity")
    integrator: str
    names: Names
    rest_lengths: dict[str, float] = Field(
        description="by tendon, m: the command at which it just hangs straight; a command is this less the pull"
    )
    actuators: list[Actuator] = Field(description="in the order of the network's outputs")
    control: str = (
        "each actuator's control is a pull in m from the straight arm, 0 for none: rest length - command. It pulls"
        " with kp (path length - rest length + pull) N and never pushes, so under tension the path stays longer than"
        " the command by tension / kp"
    )
    branches: list[BranchBlock] = Field(
        description="of joints that creep: springs and dampers in series, at rest where their joints are"
    )
    springs: list[JointLaw] = Field(
        description="of hinges, polynomials that the importer cannot read: Twin.cs restores them"
    )
    dampers: list[JointLaw] = Field(description="likewise")
    diagonals: list[TendonLaw] = Field(
        description="likewise, of tendons by which a round joint hardens by its whole bend; the file's names say which"
    )
    dead_time: float = Field(
        ge=0, description="s from a command to the motor's first answer, which the file has not: send commands so late"
    )
    rate_limit: float = Field(
        ge=0, description="m/s of cable that a motor winds at most, 0 for no limit; which the file has not: send slower"
    )
    backlash: float = Field(ge=0, description="m of cable, of the motors' winches, which the file has not")
    capstan_friction: float = Field(
        ge=0,
        description="μ of the cables on their holes, which the file has not; metrics.identify_control has errors with "
        "it (identified) and without (smooth)",
    )
    changes_max_deviation_mm: float = Field(
        ge=0, description="with the lines that stand in for them in the file, against the calibrated model"
    )
    import_max_deviation_mm: float = Field(
        ge=0,
        description="what the importer keeps, in 32-bit floats, springs and dampers restored, against the same",
    )


class Hybrid(_Block):
    arm: str = Field(description="the calibrated model whole, for MuJoCo itself: another file, not to be imported")
    parameters: str = Field(
        description="what was identified, a stage after the other: of each parameter `value`, `unit` and"
        " `interval_95_given_model`, and how those of a stage correlate; the latest stage counts;"
        " `lacking`, where held-out trials tell it: scales of what the model lacks at its tip, and their conditions"
    )
    robot: Robot = Field(description="what holds the arm, as `trunkline/kinematics/panda/mounts.py` says")


class SureBlock(_Block):
    pulls: float = Field(ge=0, description="m, in all, up to which the certificate has the arm's tip within 1 % of its"
                         " length from its twin's")  # fmt: skip
    tilt: float = Field(ge=0, description="deg, of the mount, up to which trials without a pull went")
    pulled_tilt: float = Field(ge=0, description="deg, likewise with a pull")


class NetworkBlock(_Block):
    file: str
    opset: int
    input: str
    input_order: list[str]
    input_meaning: str = (
        "gravity: theta_g, its angle, rad, or gx, gy, gz, its direction, of unit length; tip position, m, and"
        " orientation; all in the base frame (not Unity's)"
    )
    outputs: dict[str, str] = Field(description="what each is; `commands` are the actuators' controls, m")
    output_order: list[str] = Field(description="the tendons, in the order of the columns of commands and lengths")
    doubt_beyond: float = Field(gt=0, description="m; the arm cannot take the pose if `tip` is further from it")
    sure: SureBlock | None = Field(description="null where no trial at rest was held out")
    operators: list[str]


class GridBlock(_Block):
    file: str
    frame: str
    shape: list[int] = Field(min_length=3, max_length=3, description="points along Unity's x, y, z")
    origin: list[float] = Field(min_length=3, max_length=3, description="first point, Unity's axes, m")
    spacing: list[float] = Field(min_length=3, max_length=3, description="between points, Unity's axes, m")
    format: str = "raw little-endian float16, x fastest, then y, then z (Unity Texture3D, RHalf)"
    meaning: str = "signed distance to the surface of the reachable set, m, negative inside"
    rounded: str = ROUNDED
    overlap: float = Field(description="with the set before it was rounded: what both share over what either has")


class SheetsBlock(_Block):
    file: str
    weights: str = Field(description="another file: the matrix M of `blend`")
    directions: list[float] = Field(min_length=3, description="of gravity, x, y, z of each, Unity's axes, unit length")
    around: int = Field(gt=0, description="ways to pull around the arm")
    along: int = Field(gt=0, description="places along the tip's way on each")
    format: str = (
        "raw little-endian float16, m: x, y, z of a point in Unity's axes, places along the tip's way one after the"
        " other, then ways around the arm, then directions"
    )
    weights_format: str = "raw little-endian float64, row by row: a row a direction, 4 columns more than directions"
    blend: str = (
        "under gravity g, of unit length, the points are the sum over directions j of w_j times those of g_j,"
        " w = M [|g - g_1|^3, ..., |g - g_D|^3, 1, g]"
    )


class ReachBlock(_Block):
    frame: str = "base of the soft arm"
    angles: list[float] = Field(min_length=1, description="gravity angles of the soft grids, rad, ascending")
    grids: list[str] = Field(min_length=1, description="their names in `grids`, in the same order")
    threshold: float = Field(description="m; a signal above it means out of reach")
    tolerance: float = Field(gt=0, description="m; how near a reachable tip counts as within reach")
    sheets: SheetsBlock | None = Field(description="the surface of tips, where gravity comes from any side")
    signal: str = Field(description="m, about how far outside; how it is found")


class Mesh(_Block):
    file: str
    frame: str
    triangles: int = Field(gt=0)
    deviation: float | None = Field(
        description="m; the farthest that it is from the surface of the grid of its name, or that from it"
    )


class Manifest(_Block):
    name: str
    versions: Versions
    units: Units = Units()
    frames: Frames = Frames()
    model: Model
    hybrid: Hybrid
    network: NetworkBlock
    meshes: dict[str, Mesh]
    grids: dict[str, GridBlock]
    reach: ReachBlock
    metrics: dict[str, dict] = Field(description="metrics.json of every stage before this one")
    sha256: dict[str, str] = Field(description="of every other file in the package, by its path in it")


def names_of(model: mujoco.MjModel) -> Names:
    """Names by kind, in the order of MuJoCo's indices; the world body is left out."""
    return Names(
        bodies=[model.body(i).name for i in range(1, model.nbody)],
        joints=[model.joint(i).name for i in range(model.njnt)],
        tendons=ArmModel(model).cable_names,
        actuators=[model.actuator(i).name for i in range(model.nu)],
        sites=[model.site(i).name for i in range(model.nsite)],
    )


def actuators_of(model: mujoco.MjModel) -> list[Actuator]:
    """Those of a model that takes pulls."""
    tendons = [model.tendon(i).name for i in model.actuator_trnid[:, 0]]
    rest = rest_lengths(model).tolist()
    return [Actuator(name=model.actuator(i).name, tendon=tendons[i], rest_length=rest[i]) for i in range(model.nu)]


def branches_of(model: mujoco.MjModel) -> list[BranchBlock]:
    """Of all joints, the first of each, then the second."""
    return [
        BranchBlock(joint=model.joint(hinge).name, branch=model.joint(own_hinge).name, tie=model.tendon(tendon).name)
        for element in ArmModel(model).branches
        for hinge, own_hinge, tendon in zip(element.hinge, element.branch, element.tendon, strict=True)
    ]


def describe_model(model: mujoco.MjModel, file: str, **measured) -> Model:
    """The model's block; `measured` are its springs, dampers, steps and deviations."""
    drawn = actuators_of(model)
    return Model(
        file=file,
        time_step=model.opt.timestep,
        gravity=model.opt.gravity.tolist(),
        gravity_unity=unity_position(model.opt.gravity).tolist(),
        integrator=mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_").lower(),
        names=names_of(model),
        rest_lengths={actuator.tendon: actuator.rest_length for actuator in drawn},
        actuators=drawn,
        branches=branches_of(model),
        **measured,
    )


def hashes(files: dict[str, bytes]) -> dict[str, str]:
    """SHA-256 of each file, in hexadecimal digits."""
    return {path: hashlib.sha256(data).hexdigest() for path, data in sorted(files.items())}


def require_widths(took: list[int], gave: list[int], inputs: list[str], outputs: list[str], source: str) -> None:
    """That a network whose inputs and outputs are of widths `took` and `gave` takes `inputs`, and gives commands and
    lengths of `outputs`, and a tip.

    Raises:
        InputError: it takes or gives another number of them.
    """
    if (took, gave) != ([len(inputs)], [len(outputs), len(outputs), 3]):
        raise InputError(
            f"{source}: found inputs of width {took} and outputs of width {gave}, expected one"
            f" input ({', '.join(inputs)}) and commands and lengths of {', '.join(outputs)}, and a tip"
        )
