"""From targets to a plan: rigid inverse kinematics, the network, jerk-limited ways, shaped, and what forbids them."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.grasping import Grasping, Leg, gravity_direction
from trunkline.ar.teleop.messages import Request, Targets, World
from trunkline.ar.teleop.minimum_jerk import PEAK
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.plan_checks import check_plan
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.shaping import Shaper, shaped
from trunkline.ar.teleop.tendons import Network, bend
from trunkline.ar.teleop.trajectory import JOINTS, MotionLimits, gentle, point_to_point
from trunkline.ar.teleop.vectors import DOWN, Vector, add, conjugate, rotate, subtract
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, rotation_from_wxyz
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.kinematics.residual.residual_map import ResidualMap
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import actuated

# The shaper for the arm's swings: of a gravity direction (3,) in its base frame, the commands at the end (K,), and by
# how much they change (K,), m; `trunkline.ar.teleop.vibration` has it of a MuJoCo model.
ShaperOf = Callable[[np.ndarray, np.ndarray, np.ndarray], Shaper]

PLACES = 11  # of the mount on its advance, between which its speed is taken


@dataclass(frozen=True)
class Planner:
    """What plans are made with. `straight`: commands that leave the arm straight, m, (K,). `tolerance`: m, how far
    from its target the tip may be foreseen. `step`: s, between a plan's rows. `chain`: the arm's statics, by which the
    network's answers are corrected, and no obstacle may be in the arm's way. `grasping`: how objects are grasped.
    `advance`: m, the last part of a reach, along the tip's axis, of an arm with a `chain`; `advance_speed`: m/s, of the
    mount there, at most. `residual_map`: by how far the arm's tip rests beside the twin's, where poses tell. `lean`:
    how the arm is turned on its mount, None where nobody has seen that. `overshoot`: by how far a reach is known to end
    beside what all this says, in the base frame, m."""

    rigid: RigidIK
    network: Network
    straight: np.ndarray
    limits: MotionLimits
    mount_offset: float
    tolerance: float = 0.02
    step: float = 0.002
    shaper: ShaperOf | None = None
    chain: Chain | None = None
    grasping: Grasping | None = None
    advance: float = 0.0
    advance_speed: float = 0.1
    residual_map: ResidualMap | None = None
    lean: Rotation | None = None
    overshoot: Vector = (0.0, 0.0, 0.0)

    def plan(
        self, request: Request, world: World, joints: np.ndarray, commands: np.ndarray, beside: float = 0.0
    ) -> Plan:
        """From rest at `joints` (7,), rad, and `commands` (K,), m: approach with a straight arm, curl, and advance, so
        that the tip comes first to what is at its target; of an object that the tip target marks, approach, curl and
        lift; of one that the arm holds, transfer and release.

        Args:
            beside: m, by which the straight arm's tip is seen beside the bending plane (`Grasping.grasp`).

        Raises:
            InputError: beginning with what forbids it: limit, self-collision, out of reach, gravity, world, payload,
                grasp or release.
        """
        reasons: list[InputError] = []
        for legs in self._ways(request.targets, world, joints, commands, beside):
            try:
                return self._along(legs, request, world, joints, commands)
            except InputError as error:
                reasons.append(error)
        raise reasons[-1]

    def _along(self, legs: list[Leg], request: Request, world: World, joints: np.ndarray, commands: np.ndarray) -> Plan:
        rows, phases = [np.append(joints, commands)[None]], []
        for leg in legs:
            here, end = rows[-1][-1], np.append(leg.joints, leg.commands)
            profile = gentle if leg.gentle else point_to_point
            way = profile(here, end, self.limits, self.step, leg.seconds)
            if self.shaper is not None and leg.gravity is not None:
                change = leg.commands - here[JOINTS:] if leg.change is None else leg.change
                way = shaped(way, self.step, self.shaper(leg.gravity, leg.commands, change))
            if not phases or phases[-1][0] != leg.phase:
                phases.append((leg.phase, sum(map(len, rows)) - 1))
            rows.append(np.concatenate([way[1:], np.tile(end, (round(leg.calm / self.step), 1))]))
        every = np.concatenate(rows)
        plan = Plan(self.step, every[:, :JOINTS], every[:, JOINTS:], tuple(phases), request.package, request.world)
        check_plan(plan, world, self.mount_offset, self.chain)
        return plan

    def _ways(
        self, targets: Targets, world: World, joints: np.ndarray, commands: np.ndarray, beside: float
    ) -> Iterator[list[Leg]]:
        """The legs of each way there, the best first, each solved once it is asked for."""
        if targets.object:
            object = world.object(targets.object)
            if self.grasping is None:
                raise InputError(f"grasp: found no way of grasping {object.name}, expected a planner that has one")
            if object.support == "held":
                yield self.grasping.bring(targets, object, world, joints, commands)
            else:
                yield self.grasping.grasp(targets, object, joints, beside)
            return
        mount, curled = self._curled(targets)
        gravity = gravity_direction(targets)
        for back in self._stand_offs(targets, curled, gravity):
            with suppress(InputError):
                here = self._solve(joints, add(mount, back), targets)
                there = self._solve(here, mount, targets)
                still, seconds = np.zeros(len(curled)), self._advance_time(here, there)
                yield [
                    Leg("approach", here, self.straight, gravity),
                    Leg("curl", here, curled, gravity),
                    Leg("advance", there, curled, gravity, still, seconds, gentle=True),
                ]
        there = self._solve(joints, mount, targets)
        yield [Leg("approach", there, self.straight, gravity), Leg("curl", there, curled, gravity)]

    def _stand_offs(self, targets: Targets, curled: np.ndarray, gravity: np.ndarray) -> list[Vector]:
        """From where the mount advances, seen from where it goes, m: back along the axis of the tip at rest under the
        commands `curled` (K,) and `gravity` along a unit vector (3,)."""
        if self.chain is None or not self.advance:
            return []
        rest = actuated(self.chain.smooth, curled[None], STANDARD_GRAVITY * gravity)
        x, y, z = (float(value) for value in -rotation_from_wxyz(rest.quaternion[0]).apply(DOWN))
        turn = base_quaternion(targets.pointing, targets.heading)
        return [rotate(turn, (part * x, part * y, part * z)) for part in (self.advance, self.advance / 2)]

    def _advance_time(self, here: np.ndarray, there: np.ndarray) -> float:
        """s, in which joints go from `here` to `there` (7,), rad, gently, the mount never faster than it may; shaping
        only makes it slower."""
        share = np.linspace(0, 1, PLACES)[:, None]
        mounts = mount_pose(here + share * (there - here), self.mount_offset)[0]
        steps = np.linalg.norm(np.diff(mounts, axis=0), axis=1)
        return float(PEAK * (PLACES - 1) * steps.max() / self.advance_speed)

    def goal(self, targets: Targets, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joints (7,), rad, the nearest to `joints`, and commands (K,), m, that bring mount and tip to their targets.

        Raises:
            InputError: beginning with what forbids it, as `plan`.
        """
        mount, curled = self._curled(targets)
        return self._solve(joints, mount, targets), curled

    def _solve(self, start: np.ndarray, mount: Vector, targets: Targets) -> np.ndarray:
        return self.rigid.solve(start, mount, targets.pointing, targets.heading)

    def _curled(self, targets: Targets) -> tuple[Vector, np.ndarray]:
        """Where the mount goes, m, and the commands (K,) that then bring the tip to its target.

        An arm that only bends passes its target by some mm, within `tolerance`: the mount makes up for what is
        foreseen.
        """
        turn = base_quaternion(targets.pointing, targets.heading)
        back = conjugate(turn)
        tip = rotate(back, subtract(subtract(targets.tip.position, self.overshoot), targets.rigid.position))
        down, tolerance = rotate(back, DOWN), self.tolerance + float(np.linalg.norm(self.overshoot))
        bent = bend(self.network, tip, down, tolerance, self.chain, self.residual_map, self.lean)
        missed = rotate(turn, subtract(tip, (float(bent.tip[0]), float(bent.tip[1]), float(bent.tip[2]))))
        return add(targets.rigid.position, missed), bent.commands
