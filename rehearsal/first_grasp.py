"""A first grasp on the stand-in by a motion set by hand: beside a cylinder or a basket's bar, pull, lift, hold.

    python -m rehearsal.first_grasp [PICTURES]

tries placements of the arm and prints of each whether it holds, and into the folder PICTURES, if given, it draws them.
The scene is built round the arm: it hangs at rest, and the object is put beside it. The arm comes from the side,
waits until it is calm, pulls one tendon, lifts and holds. There is no twin and no network in here: it says what the
stand-in can hold.
"""

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from demo.plants.bench import LOOSE
from demo.plants.choice import plant_of
from demo.plants.stranger import Stranger
from demo.rig import ROOT as LAB
from demo.rig import Config as Lab
from rehearsal.operator.hands import as_hands_move
from rehearsal.robot.scene import LabScene, SceneObject
from rehearsal.robot.stand_in import SUBSTEPS, StandIn, StandInRobot, TrueState
from trunkline.ar.hybrid.worlds import SupportSurface
from trunkline.frames import wxyz_from_rotation
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN, mount_pose
from trunkline.pipeline.config import load_config
from trunkline.settings import read_yaml

SETTINGS = Path(__file__).parent / "conf/rehearse/robot/stand_in.yaml"
DIAMETER, HEIGHT, MASS, STRING = 0.05, 0.12, 0.1, 0.15  # m, m, kg, m
PULL, LIFT, ASIDE = 0.18, 0.1, 0.16  # m, m, m by which the arm comes from the side
TABLES = {"cylinder": [0.08, 0.08, 0.03], "basket": [0.2, 0.2, 0.03]}  # m, each for its object
FLOOR = -0.75  # m; the robot stands on a stand
SETTLE, CLOSE, HOLD = 3.0, 1.5, 5.0  # s
SLIP = 0.02  # m by which what is held may move in the arm
CLEARANCE = 0.01  # m, of the arm's last unit above the table
LOOSENED = np.array([0.0, -LOOSE, -LOOSE])  # m of pull of a straight arm that only tendon 1 will bend
TIME_STEP = 0.02  # s, between commands
MOUNT = np.array([0.45, 0.0, 0.35])  # m, of the arm's base while it grasps
START = np.array([0.0, -0.2, 0.0, -1.9, 0.0, 1.7, 0.785])  # rad, where the search for joints begins


@dataclass
class Placement:
    """tilt_deg: of the straight arm from straight down, forwards. sideways: whether it bends sideways, else forwards in
    the vertical plane. beyond: m of the arm beyond the middle of the cylinder, or of the basket's bar. hanging: whether
    the cylinder hangs from a hook, its axis level and across the bending plane; else it stands on a table, as a basket
    does. gap: m, between arm and object. mass: kg. diameter: of cylinder or bar, m. height: of cylinder or box, m."""

    name: str
    tilt_deg: float
    sideways: bool
    beyond: float
    hanging: bool = False
    gap: float = 0.01
    shape: Literal["cylinder", "basket"] = "cylinder"
    diameter: float = DIAMETER
    height: float = HEIGHT
    mass: float = MASS


@dataclass
class GraspOutcome:
    """success: lifted by more than half of LIFT, off the hook, and HOLD s later within 20 mm of its place in the arm.
    lifted, slipped: m; slipped is how far it moved in the arm while the Panda stood still, creep the same of the last
    2 s, infinite if nothing held it. units: that touch it at last. force: N, sum of their loads. cpu: s of processor
    for a simulated s."""

    success: bool
    lifted: float
    slipped: float
    creep: float
    units: int
    force: float
    cpu: float


def base_rotation(placement: Placement) -> np.ndarray:
    """The arm's frame in the world: arm along -z, tendon 1 over +x. Bending sideways is towards +y of the world."""
    side = Rotation.from_euler("z", np.pi / 2) if placement.sideways else Rotation.identity()
    return (Rotation.from_euler("y", -np.radians(placement.tilt_deg)) * side).as_matrix()


def joints_for(place: np.ndarray, rotation: np.ndarray, offset: float, start: np.ndarray) -> np.ndarray:
    """The Panda's joints that put the arm's base there, by least squares from `start`, (7,) rad."""
    flange = rotation @ np.diag([1.0, -1.0, -1.0])

    def off(q: np.ndarray) -> np.ndarray:
        places, turn = mount_pose(q[None], offset)
        return np.concatenate([
            10 * (places[0] - place), Rotation.from_matrix(turn[0] @ flange.T).as_rotvec(), 0.01 * (q - start)
        ])  # fmt: skip

    return least_squares(off, start, bounds=(Q_MIN, Q_MAX)).x


class GraspTrial:
    """One placement: the scene, the robot in it, and pictures of the way."""

    def __init__(
        self, arm: Stranger, settings: StandIn, placement: Placement, seed: int, substeps: int = SUBSTEPS
    ) -> None:
        rotation, offset = base_rotation(placement), settings.panda.mount_offset
        self.grasp = joints_for(MOUNT, rotation, offset, START)
        self.lift = joints_for(MOUNT + [0, 0, LIFT], rotation, offset, self.grasp)
        self.aside = joints_for(MOUNT - [0, ASIDE, 0], rotation, offset, self.grasp)
        shape = (placement.shape, placement.diameter, placement.height, placement.mass)
        far = LabScene(None, SceneObject(*shape, [5.0, 5.0, 5.0]), {})
        centres, _ = StandInRobot(arm, far, settings, self.grasp, seed, LOOSENED).links()
        unit = int(np.searchsorted(np.cumsum(arm.chain.lengths), arm.chain.length - placement.beyond))
        side = rotation[:, 0] * [1, 1, 0] / np.linalg.norm(rotation[:2, 0])
        middle = centres[unit] + side * ((placement.diameter + arm.chain.widths[unit]) / 2 + placement.gap)
        if placement.hanging:
            turn = Rotation.from_rotvec(np.pi / 2 * side)  # its axis level, across the bending plane
            object = SceneObject(*shape, middle.tolist(), wxyz_from_rotation(turn).tolist(), True)
            hook = middle + [0, 0, placement.diameter / 2 + STRING]
            self.scene = LabScene(FLOOR, object, {}, hook.tolist())
        else:
            object = SceneObject(*shape, [0.0, 0.0, 0.0])
            place = middle - object.grip
            if placement.shape == "cylinder" and not placement.sideways:
                place[2] = centres[-1][2] + object.half_height - CLEARANCE
            object.position = place.tolist()
            top = place - [0, 0, object.half_height]
            table = SupportSurface(top.tolist(), TABLES[placement.shape], "wood")
            self.scene = LabScene(FLOOR, object, {"table": table})
        self.robot = StandInRobot(arm, self.scene, settings, self.aside, seed, LOOSENED, substeps)
        self.pictures: list[tuple[str, np.ndarray, TrueState]] = []

    def go(self, duration: float, start: np.ndarray, end: np.ndarray, pulls: tuple[np.ndarray, np.ndarray]) -> None:
        for n in range(round(duration / TIME_STEP)):
            share = as_hands_move((n + 1) * TIME_STEP / duration)
            self.robot.send(start + share * (end - start), pulls[0] + share * (pulls[1] - pulls[0]))
            self.robot.advance(TIME_STEP)

    def picture(self, name: str) -> None:
        self.pictures.append((name, self.robot.links()[0], self.robot.truth()))

    def moved(self, since: str) -> float:
        """m by which the object has moved against the units that held it at that picture: the arm may swing."""
        now = self.robot.links()[0], self.robot.truth()
        then = next((centres, truth) for name, centres, truth in self.pictures if name == since)
        holding = np.linalg.norm(then[1].arm_object, axis=1) > 0
        if not holding.any():
            return float("inf")
        before, after = (truth.grip - centres[holding].mean(axis=0) for centres, truth in (then, now))
        return float(np.linalg.norm(after - before))

    def run(self) -> GraspOutcome:
        loose, drawn = LOOSENED, np.array([PULL, -LOOSE, -LOOSE])
        begun = time.process_time()
        first = self.robot.truth().object
        self.picture("start")
        self.go(1.0, self.aside, self.grasp, (loose, loose))
        self.go(SETTLE, self.grasp, self.grasp, (loose, loose))
        self.picture("beside it")
        self.go(CLOSE, self.grasp, self.grasp, (loose, drawn))
        self.go(1.0, self.grasp, self.grasp, (drawn, drawn))
        self.picture("pulled")
        self.go(1.5, self.grasp, self.lift, (drawn, drawn))
        self.picture("lifted")
        self.go(HOLD - 2.0, self.lift, self.lift, (drawn, drawn))
        self.picture("calm")
        self.go(2.0, self.lift, self.lift, (drawn, drawn))
        self.picture("held")
        last = self.robot.truth()
        loads = np.linalg.norm(last.arm_object, axis=1)
        lifted, slipped = float(last.object[2] - first[2]), self.moved("lifted")
        return GraspOutcome(
            success=holds(lifted, slipped, last.hanging), lifted=lifted, slipped=slipped,
            creep=self.moved("calm"), units=int((loads > 0).sum()), force=float(loads.sum()),
            cpu=(time.process_time() - begun) / self.robot.time,
        )  # fmt: skip


def holds(lifted: float, slipped: float, hanging: bool) -> bool:
    """Whether an object is held that is so much higher than at first, m, has moved so far in the arm, m, and hangs or
    not."""
    return lifted > LIFT / 2 and slipped < SLIP and not hanging


PLACEMENTS = [
    Placement("hanging, arm straight down, 0.15 m beyond", 0, False, 0.15, hanging=True),
    Placement("hanging, arm straight down, 0.20 m beyond", 0, False, 0.2, hanging=True),
    Placement("hanging, arm straight down, 0.12 m beyond", 0, False, 0.12, hanging=True),
    Placement("standing, arm straight down", 0, False, 0.1),
    Placement("standing, arm at 120 deg, bends sideways, 0.15 m beyond", 120, True, 0.15),
    Placement("basket on a table, arm straight down, 0.15 m beyond its bar", 0, False, 0.15, shape="basket",
              diameter=0.03, height=0.06, mass=0.2),
]  # fmt: skip


def main() -> None:
    import pydantic
    from omegaconf import OmegaConf

    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    only = [int(word) for word in sys.argv[2:]] or range(len(PLACEMENTS))
    settings = pydantic.TypeAdapter(StandIn).validate_python(OmegaConf.to_container(read_yaml(SETTINGS)))
    arm = plant_of(load_config(Lab, "record", LAB))
    assert isinstance(arm, Stranger)
    for index in only:
        trial = GraspTrial(arm, settings, PLACEMENTS[index], seed=1)
        outcome = trial.run()
        print(
            f"{PLACEMENTS[index].name}: {'held' if outcome.success else 'not held'}, "
            f"lifted by {1000 * outcome.lifted:.0f} mm, "
            f"moved by {1000 * outcome.slipped:.1f} mm in {HOLD:.0f} s, {1000 * outcome.creep:.2f} mm in the last 2 s, "
            f"{outcome.units} units press with {outcome.force:.1f} N; {outcome.cpu:.2f} s of processor a second",
            flush=True,
        )
        if folder is not None:
            from rehearsal.picture import draw

            draw(trial, folder / f"first_grasp_{index + 1}.png")


if __name__ == "__main__":
    main()
