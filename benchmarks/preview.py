"""Previews of a grasp by the identified arm on the Panda: seconds of processor, and what a coarser time step changes.

    python -m benchmarks.preview [arm.xml] [--count 32]

The arm hangs straight, closes on a hanging cylinder of 40 mm and 100 g in 1 s, which is let go at 1.75 s; it lifts it
until 4 s. What is not known is drawn from the intervals of the three stages of identification. Compilation is not
counted. A machine's seconds are those of processor over its cores, as futures are independent.
"""

import argparse
import time
from pathlib import Path

import mujoco
import numpy as np

from trunkline.ar.hybrid.compose import Placed, compose
from trunkline.ar.hybrid.grasps import CABLES, Grasp, object_in_base
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.outcomes import Holding
from trunkline.ar.hybrid.rollout_batch import nominal, preview
from trunkline.ar.hybrid.rollouts import CommandTrajectory, ComposedTwin
from trunkline.ar.hybrid.settings import HybridModelSettings
from trunkline.ar.hybrid.uncertainty import GraspUncertainty
from trunkline.ar.hybrid.worlds import WorldGeometry
from trunkline.ar.teleop.minimum_jerk import minimum_jerk
from trunkline.compute.threads import thread_count
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.kinematics.panda.mounts import PandaRobot
from trunkline.model.arm.contact_geometry import read_geometry
from trunkline.model_files import read_spec
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.twin.twin import Twin
from upkeep.results import recorded

STEPS = (1 / 480, 1 / 240, 1 / 200)  # s; joint limits and contacts, of 0.01 s, allow no longer one than 5 ms
CLOSE, LET_GO, LENGTH, PULL, LIFT = 1.0, 1.75, 4.0, 0.2, 0.3  # s, s, s, m of cable, rad of the Panda's second joint
PAID_OUT, PAY_TIME = 0.2, 0.3  # m and s, of cables that do not pull
DIAMETER, MASS = 0.04, 0.1  # m and kg, of the cylinder
GRASP = Grasp(wrap=0.6, gap=0.02)
HOOK_ABOVE = 0.15  # m, of the cylinder's upper side: the length of what it hangs by
LEVEL = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)  # turns an object's z to base y


@recorded("preview")
def main(path: Path, count: int) -> None:
    twin, way = grasp(path)
    doubts = GraspUncertainty(posterior=Twin.load(path).posterior)
    holding = Holding(LET_GO, sag=0.25)
    list(nominal(twin, CommandTrajectory(way.step, way.joints[:100], way.commands[:100])))  # names are looked up once
    print(f"{path}: {twin.model.nv} degrees of freedom, {count} futures of {LENGTH:g} s, {thread_count()} threads")
    first = None
    for step in STEPS:
        own, spans, began = twin.stepped(step), [], time.process_time()
        pieces = lambda piece, spans=spans, began=began: spans.append(time.process_time() - began)  # noqa: E731
        found = preview(own, way, doubts, holding, count, show=pieces)
        spent = time.process_time() - began
        first = found if first is None else first
        low, high = found.interval or (0.0, 1.0)
        print(
            f"step {1e3 * step:.2f} ms: first piece after {spans[0]:.3f} s of processor, nominal {spans[-1]:.2f} s, "
            f"all {spent:.1f} s ({(spent - spans[-1]) / count:.2f} s a future); "
            f"holds with {found.probability:.2f} ({low:.2f} to {high:.2f})"
        )
        same = int(np.sum(found.success == first.success))
        frames = [int(np.argmin(np.abs(motion.time - LET_GO))) for motion in (found.motion, first.motion)]
        tips = [motion.tip[:, frame] for motion, frame in zip((found.motion, first.motion), frames, strict=True)]
        apart = 1e3 * np.median(np.linalg.norm(tips[0] - tips[1], axis=1))
        print(
            f"    {same} of {count} outcomes as with the first step; tips {apart:.1f} mm apart in the middle "
            f"at {LET_GO:g} s; spread of tips {1e3 * found.spread[frames[0]]:.0f} mm then, "
            f"{1e3 * found.spread[-1]:.0f} mm at last"
        )


def grasp(path: Path) -> tuple[ComposedTwin, CommandTrajectory]:
    """The Panda in its ready pose with the arm beside the cylinder, and the motion."""
    spec, robot = read_spec(path), load_folder(HybridModelSettings, PROJECT / "conf/hybrid").robot
    middle = object_in_base(read_geometry(spec), DIAMETER, GRASP, "dorsal")
    assert isinstance(robot, PandaRobot)
    ready = np.array(robot.ready)
    mounts, turns = mount_pose(ready[None], robot.mount_offset)
    base = turns[0] @ np.diag([1.0, -1.0, -1.0])
    center = mounts[0] + base @ middle
    hook = [float(value) for value in center + [0, 0, DIAMETER / 2 + HOOK_ABOVE]]
    object = GraspObject("cylinder", DIAMETER, 0.12, MASS, "plastic")
    level = np.zeros(4)
    mujoco.mju_mat2Quat(level, base.ravel())
    mujoco.mju_mulQuat(level, level.copy(), np.array(LEVEL))
    placed = Placed(object, center, (level[0], level[1], level[2], level[3]), True)
    model = compose(spec, robot, WorldGeometry(None, {}, hook), placed).compile()
    model.geom_contype[model.geom("hook").id] = 0  # a string: the rod above the hook's end would stand in the flange
    arm, time_step = spec.compile(), 0.002
    times = time_step * np.arange(round(LENGTH / time_step) + 1)[:, None]
    pulls = CABLES["dorsal"]
    straight = arm.tendon_length0[arm.actuator_trnid[:, 0]]
    drawn = np.where(pulls > 0, -PULL * np.minimum(times / CLOSE, 1), PAID_OUT * np.minimum(times / PAY_TIME, 1))
    share = np.clip((times - LET_GO) / 1.5, 0, 1)
    joints = np.tile(ready, (len(times), 1))
    joints[:, 1:2] -= minimum_jerk(share, LIFT)
    return ComposedTwin(model, arm), CommandTrajectory(time_step, joints, straight + drawn, LET_GO)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", nargs="?", type=Path, default=Path("artifacts/identify_control/arm.xml"))
    parser.add_argument("--count", type=int, default=32)
    options = parser.parse_args()
    main(options.path, options.count)
