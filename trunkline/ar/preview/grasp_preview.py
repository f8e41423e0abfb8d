"""What a client shows of a plan for a grasp or a hand-over before it is confirmed: a preview, and perhaps an offer.

Futures of a grasp begin where the approach ends: until then nothing is touched. Those of a hand-over begin with the arm
and the object as the nominal preview of its grasp left them, and end when the arm is gone.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from trunkline.ar.hybrid.assistant import surest, try_places
from trunkline.ar.hybrid.grasp_poses import Grip
from trunkline.ar.hybrid.outcomes import Holding, RestCriterion
from trunkline.ar.hybrid.rollout_batch import PlanPreview, preview
from trunkline.ar.hybrid.rollouts import CommandTrajectory, ComposedTwin
from trunkline.ar.hybrid.uncertainty import Contact
from trunkline.ar.preview.preview_twin import RobotModel, compose_twin
from trunkline.ar.preview.settings import Previewing
from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.messages import Offer, Targets, World, WorldObject
from trunkline.ar.teleop.object_shapes import beneath, grip_of, way_of_grasping
from trunkline.ar.teleop.plan import Plan
from trunkline.frames import rotation_from_wxyz
from trunkline.kinematics.residual.residual_map import ResidualMap

NOWHERE = (0.0, 0.0, 0.0)
FINALISTS = 2  # places that the assistant tries once more


@dataclass(frozen=True)
class PlanPrediction:
    """preview: from `begins` s of the plan on. offer: the assistant's, None where it has nothing better."""

    preview: PlanPreview
    begins: float
    offer: Offer | None = None

    @property
    def probability(self) -> float:
        """That all goes well, as the futures say."""
        probability = self.preview.probability
        assert probability is not None
        return probability


@dataclass(frozen=True)
class GraspPreviewer:
    """grips: those of the planner, by the way of grasping."""

    robot_model: RobotModel
    grips: dict[str, Grip]
    settings: Previewing

    def grasp(
        self,
        plan: Plan,
        targets: Targets,
        object: WorldObject,
        world: World,
        hangs: np.ndarray | None,
        seed: int,
        go_on: Callable[[], None] = lambda: None,
    ) -> Iterator[PlanPrediction]:
        """Futures of a plan to grasp; where they are not sure to hold, once more with what the assistant offers.

        Args:
            hangs: where the straight arm's tip is seen in its base frame, (3,), m: the twin leans likewise. None where
                nobody has seen it.
            go_on: as `preview`.
        """
        s, trajectory, begins = self.settings, *self.trajectory_from(plan, "curl")
        lean = self.robot_model.lean(hangs)
        twin = compose_twin(self.robot_model, world, object, trajectory.joints[0], trajectory.commands[0], s, lean)
        holding = Holding(trajectory.duration - s.hold, s.sag, s.slip, s.lifted)
        prediction = PlanPrediction(
            preview(twin, trajectory, self.robot_model.uncertainty, holding, s.futures, seed, go_on=go_on), begins
        )
        yield prediction
        if prediction.probability < s.sure and s.assistant:
            offer = self._offer(twin, trajectory, holding, targets, object, prediction.probability, seed, go_on)
            yield replace(prediction, offer=offer)

    def bring(
        self,
        plan: Plan,
        targets: Targets,
        object: WorldObject,
        world: World,
        hangs: np.ndarray | None,
        before: PlanPrediction,
        seed: int,
        go_on: Callable[[], None] = lambda: None,
    ) -> PlanPrediction:
        """Futures of a plan to bring what is held elsewhere: whether it rests there.

        Args:
            before: of the grasp. What is not known of the object's place is none of an object in the arm.
            go_on: as `preview`.
        """
        s, trajectory, begins = self.settings, *self.trajectory_from(plan, "transfer")
        twin = self.carrying(object, world, trajectory, hangs, before)
        uncertainty = replace(
            self.robot_model.uncertainty, contact=Contact(self.robot_model.uncertainty.contact.friction, NOWHERE, 0.0)
        )
        board = beneath(targets.tip.position, world)
        assert board is not None  # else the planner refuses
        opens = plan.step * dict(plan.phases)["release"]
        resting = RestCriterion(opens, np.array(board.low), np.array(board.high), twin.model)
        return PlanPrediction(preview(twin, trajectory, uncertainty, resting, s.futures, seed, go_on=go_on), begins)

    def free(
        self,
        twin: ComposedTwin,
        trajectory: CommandTrajectory,
        hangs: np.ndarray | None,
        seed: int,
        go_on: Callable[[], None] = lambda: None,
        learnt: ResidualMap | None = None,
        hysteresis: np.ndarray | None = None,
    ) -> PlanPrediction:
        """Futures of which nothing is asked but where the tip goes. `hangs`, `go_on`: as of `grasp`; `learnt` and
        `hysteresis`: as of `tip_uncertainty`."""
        tip = self.robot_model.tip_uncertainty(trajectory, hangs, learnt, hysteresis)
        uncertainty, futures = self.robot_model.uncertainty, self.settings.futures
        return PlanPrediction(
            preview(twin, trajectory, uncertainty, None, futures, seed, go_on=go_on, tip=tip), 0.0
        )

    def whole(self, plan: Plan, grasps: bool) -> CommandTrajectory:
        """All of a plan, then held as futures are that grasp or bring something, else at least until the arm rests."""
        s = self.settings
        return self._extended(plan, 0, s.hold if grasps else max(s.hold, self.robot_model.rest_time))

    def carrying(
        self,
        object: WorldObject,
        world: World,
        trajectory: CommandTrajectory,
        hangs: np.ndarray | None,
        before: PlanPrediction,
    ) -> ComposedTwin:
        """The twin with the object in its arm, as the nominal preview of its grasp left both."""
        lean, pose = self.robot_model.lean(hangs), before.preview.nominal.qpos[0, -1]
        return compose_twin(
            self.robot_model, world, object, trajectory.joints[0], trajectory.commands[0], self.settings, lean, pose
        )

    def trajectory_from(self, plan: Plan, first: str) -> tuple[CommandTrajectory, float]:
        """The plan from the phase `first` on, held for a while at its end, and when that phase begins, s."""
        row = dict(plan.phases)[first]
        return self._extended(plan, row, self.settings.hold), plan.step * row

    @staticmethod
    def _extended(plan: Plan, row: int, hold: float) -> CommandTrajectory:
        """The plan from `row` on, held for `hold` s at its end."""
        more = round(hold / plan.step)
        joints, commands = (
            np.concatenate([rows[row:], np.tile(rows[-1], (more, 1))]) for rows in (plan.joints, plan.commands)
        )
        return CommandTrajectory(plan.step, joints, commands)

    def _offer(
        self,
        twin: ComposedTwin,
        trajectory: CommandTrajectory,
        holding: Holding,
        targets: Targets,
        object: WorldObject,
        probability: float,
        seed: int,
        go_on: Callable[[], None],
    ) -> Offer | None:
        s, centre = self.settings, np.array(grip_of(object))
        mount = np.array(targets.rigid.position) - centre
        places = self.grips[way_of_grasping(object)].near(_rotation(targets), mount, object.diameter)
        tried = partial(try_places, twin, trajectory, self.robot_model.uncertainty, holding)
        few = places[surest(places - mount, tried(places - mount, s.assistant, seed + 1, go_on))[:FINALISTS]]
        shares = tried(few - mount, s.futures, seed + 2, go_on)
        chosen = surest(few - mount, shares)[0]
        if shares[chosen] <= probability:
            return None
        x, y, z = (float(value) for value in centre + few[chosen])
        return Offer(object.name, (x, y, z), targets.pointing, float(shares[chosen]))


def _rotation(targets: Targets) -> np.ndarray:
    """Axes of the arm's base frame, in columns. Shape (3, 3)."""
    return rotation_from_wxyz(np.array(base_quaternion(targets.pointing, targets.heading))).as_matrix()
