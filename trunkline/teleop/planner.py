"""From targets to a plan: rigid inverse kinematics, the network, jerk-limited ways, shaped, and what forbids them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from trunkline.errors import InputError
from trunkline.panda.collision import clearance
from trunkline.panda.kinematics import FLANGE, Q_MAX, Q_MIN, joint_frames
from trunkline.statics.chain import Chain
from trunkline.teleop.alignment import base_quaternion
from trunkline.teleop.messages import Request, Targets, World
from trunkline.teleop.plan import Plan
from trunkline.teleop.rigid_ik import RigidIK
from trunkline.teleop.shaping import Shaper, shaped
from trunkline.teleop.tendons import Network, bend
from trunkline.teleop.trajectory import JOINTS, Limits, point_to_point
from trunkline.teleop.vectors import DOWN, Vector, add, conjugate, rotate, scale, subtract

UP: Vector = (0.0, 0.0, 1.0)
LINK_RADIUS = 0.08  # m, about the joints' centres and the mount, that no solid of the world may come into

# The shaper for the arm's swings: of a gravity direction (3,) in its base frame, the commands at the end (K,), and by
# how much they change (K,), m; `trunkline.teleop.swing` has it of a MuJoCo model.
ShaperOf = Callable[[np.ndarray, np.ndarray, np.ndarray], Shaper]


@dataclass(frozen=True)
class Planner:
    """What plans are made with. `straight`: commands that leave the arm straight, m, (K,). `tolerance`: m, how far
    from its target the tip may be foreseen. `step`: s, between a plan's rows. `chain`: the arm's statics, by which the
    network's answers are corrected."""

    rigid: RigidIK
    network: Network
    straight: np.ndarray
    limits: Limits
    mount_offset: float
    tolerance: float = 0.02
    step: float = 0.002
    shaper: ShaperOf | None = None
    chain: Chain | None = None

    def plan(
        self,
        request: Request,
        world: World,
        joints: np.ndarray,
        commands: np.ndarray,
        lift: float = 0.0,
        place: Targets | None = None,
    ) -> Plan:
        """From rest at `joints` (7,), rad, and `commands` (K,), m: approach with a straight arm and curl; with `lift`
        m, lift; with `place`, transfer there and release.

        Raises:
            InputError: beginning with what forbids it: limit, self-collision, out of reach, gravity or world.
        """
        targets = request.targets
        mount, _ = self._curled(targets)
        there, curled = self.goal(targets, joints)
        goals = [("approach", there, self.straight), ("curl", there, curled)]
        if lift > 0:
            above = self.rigid.solve(there, add(mount, scale(UP, lift)), targets.pointing, targets.heading)
            goals.append(("lift", above, curled))
        if place is not None:
            goals.append(("transfer", self.goal(place, goals[-1][1])[0], curled))
            goals.append(("release", goals[-1][1], self.straight))
        here = np.append(joints, commands)
        rows, phases = [here[None]], []
        for name, end_joints, end_commands in goals:
            end = np.append(end_joints, end_commands)
            way = point_to_point(here, end, self.limits, self.step)
            if self.shaper is not None:
                base = place if place is not None and name in ("transfer", "release") else targets
                gravity = np.array(rotate(conjugate(base_quaternion(base.pointing, base.heading)), DOWN))
                way = shaped(way, self.step, self.shaper(gravity, end_commands, end_commands - here[JOINTS:]))
            phases.append((name, sum(map(len, rows)) - 1))
            rows.append(way[1:])
            here = end
        every = np.concatenate(rows)
        found = Plan(self.step, every[:, :JOINTS], every[:, JOINTS:], tuple(phases), request.package, request.world)
        refuse(found, world, self.mount_offset)
        return found

    def goal(self, targets: Targets, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joints (7,), rad, the nearest to `joints`, and commands (K,), m, that bring mount and tip to their targets.

        Raises:
            InputError: beginning with what forbids it, as `plan`.
        """
        mount, curled = self._curled(targets)
        return self.rigid.solve(joints, mount, targets.pointing, targets.heading), curled

    def _curled(self, targets: Targets) -> tuple[Vector, np.ndarray]:
        """Where the mount goes, m, and the commands (K,) that then bring the tip to its target.

        An arm that only bends passes its target by some mm, within `tolerance`: the mount makes up for what is
        foreseen.
        """
        tip, gravity = _soft_target(targets)
        bent = bend(self.network, tip, gravity, self.tolerance, self.chain)
        turn = base_quaternion(targets.pointing, targets.heading)
        missed = rotate(turn, subtract(tip, (float(bent.tip[0]), float(bent.tip[1]), float(bent.tip[2]))))
        return add(targets.rigid.position, missed), bent.commands


def _soft_target(targets: Targets) -> tuple[Vector, Vector]:
    """Tip target and gravity direction in the soft arm's base frame."""
    back = conjugate(base_quaternion(targets.pointing, targets.heading))
    return rotate(back, subtract(targets.tip.position, targets.rigid.position)), rotate(back, DOWN)


def refuse(plan: Plan, world: World, mount_offset: float) -> None:
    """Whether the rigid robot's way is free.

    Raises:
        InputError: a joint beyond its limits, the robot touching itself, or one of its joints in a solid of the world.
    """
    for joint in range(JOINTS):
        angles = plan.joints[:, joint]
        if angles.min() < Q_MIN[joint] or angles.max() > Q_MAX[joint]:
            raise InputError(f"limit: joint {joint + 1} of the rigid robot would leave its range on the way")
    gaps = clearance(plan.joints, mount_offset)
    if gaps.min() <= 0:
        when = plan.step * int(np.argmin(gaps))
        raise InputError(
            f"self-collision: the robot would touch itself after {when:.2f} s, by {-1e3 * gaps.min():.0f} mm"
        )
    frames = joint_frames(plan.joints)
    mount = frames[-1].p + (FLANGE + mount_offset) * frames[-1].z
    moving = [(f"joint {i + 1}", frame.p) for i, frame in enumerate(frames) if i >= 2] + [("mount", mount)]
    for box in world.boxes:
        low, high = np.array(box.low)[:, None], np.array(box.high)[:, None]
        for name, path in moving:
            away = np.linalg.norm(np.maximum(np.maximum(low - path, path - high), 0.0), axis=0)
            if away.min() < LINK_RADIUS:
                when = plan.step * int(np.argmin(away))
                raise InputError(f"world: {name} of the rigid robot would come into {box.name} after {when:.2f} s")
