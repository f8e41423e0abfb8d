"""What a user gets: the network's commands sent to MuJoCo, which is stepped until the arm rests.

Targets are poses in which MuJoCo itself came to rest, under gravities that no sample has, one or two neighbouring
motors of every section pulling by random amounts. No statics of ours is part of the score.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field, PositiveFloat
from scipy.stats import binom

from trunkline.kinematics.dataset.columns import POSE
from trunkline.kinematics.dataset.sampling import around_the_arm, in_sections, sections
from trunkline.kinematics.ik.inputs import draw_gravity, gravity_of, position_of
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.drive import drive, has_friction
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.hysteresis import model_friction

PATIENCE = 15.0  # s to rest for a pose that is to be a target
NEAR_LIMIT = 0.95  # share of its largest force at which a motor is near it: there other commands hold the same pose
TAUT_SHARE = 0.2  # of the deepest pulls, where all motors pull: more bends hardly more and presses the units together
SHARE = 0.01  # of the arm's length; a larger error is worth a warning
DOUBT = 0.75 * SHARE  # from which on a foreseen miss is a reason to doubt: what is foreseen has an error of its own
SWING = 4.0  # s that an arm without friction swings by itself before it is damped: then it has its shape
PULL_SHARE = 0.8  # of the deepest pulls of the samples: together, two of them are near the motors' limits

Ask = Callable[[np.ndarray], dict[str, np.ndarray]]  # as `ask.ask`, of one network


@dataclass
class AsControls:
    """See conf/train_ik/config.yaml.

    targets: that are drawn; some of them are left out, see `Drawn`. timed: how many of them are driven
    without friction for as long as it takes, to see how long that is. sent: how many are sent at once to a model with
    friction. on_rig: how many of these to the arm itself, where a rig drives it. seconds: longest time to rest.
    """

    targets: Annotated[int, Field(ge=8, le=100_000)]
    timed: Annotated[int, Field(ge=1, le=100_000)]
    sent: Annotated[int, Field(ge=1, le=100_000)]
    on_rig: Annotated[int, Field(ge=1, le=100_000)]
    seconds: Annotated[PositiveFloat, Field(le=120)]


@dataclass
class Drawn:
    """Poses in which an arm rests, of those that were drawn.

    Attributes:
        targets: inputs of the network. Shape (N, 7, 8 or 10).
        commands: of the tendons, m, under which the arm rests so. Shape (N, K).
        near_limit: how many were left out in which a motor is near its limit.
        unrested: how many were left out in which the arm had not come to rest, whatever its motors then did.
    """

    targets: np.ndarray
    commands: np.ndarray
    near_limit: int
    unrested: int

    def counts(self) -> dict:
        left_out = {"near_limit": self.near_limit, "unrested": self.unrested}
        return {"targets": len(self.targets), "left_out": left_out}


def draw_targets(
    model: mujoco.MjModel,
    chain: Chain,
    sampled: np.ndarray,
    deepest: np.ndarray,
    count: int,
    rng: np.random.Generator,
    others_pay_out: bool = True,
) -> Drawn:
    """Poses in which MuJoCo rests without friction under one or two neighbouring motors of every section, none near
    its limit.

    Args:
        sampled: gravity inputs of the samples; others are drawn between them, see `inputs.draw_gravity`. Shape (G, 0, 1
            or 3).
        deepest: of each tendon, how far it is drawn in at most, m. Shape (K,).
        others_pay_out: whether motors that do not pull give way; else they stay where the straight arm has them, and
            pull against the others as the arm bends: shapes that the data set has none of.
    """
    gravity, commands = draw_commands(chain, sampled, deepest, count, rng, others_pay_out)
    rest = settle(model, commands[:, model.actuator_trnid[:, 0]], _gravity_vectors(gravity), PATIENCE)
    tensions = rest.tensions[:, ArmModel(model).actuators]
    near_limit = ~(tensions < NEAR_LIMIT * chain.max_tension).all(axis=1)
    targets, chosen = np.column_stack([gravity, rest.position, rest.quaternion]), rest.rested & ~near_limit
    targets, commands = targets[chosen], commands[chosen]
    return Drawn(targets, commands, int((rest.rested & near_limit).sum()), int((~rest.rested).sum()))


def draw_commands(
    chain: Chain, sampled: np.ndarray, deepest: np.ndarray, count: int, rng: np.random.Generator, others_pay_out: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Gravities (count, 0, 1 or 3) and commands, m (count, K), as `draw_targets` has them; its words. Of an arm of
    several sections, as many of them as its motors reach."""
    gravity = draw_gravity(sampled, count, rng)
    if len(sections(chain)) > 1:
        result, within = in_sections(chain, _gravity_vectors(gravity), count, deepest, rng)
        idle = chain.straight_lengths + others_pay_out * chain.length
        return gravity[within], np.where(result.tensions == 0, idle, result.commands)[within]
    first = rng.integers(chain.tendons, size=count)
    order = around_the_arm(chain)
    place = np.argsort(order)
    second = order[(place[first] + 1) % chain.tendons]
    pulls = np.zeros((count, chain.tendons))
    pulls[np.arange(count), first] = rng.uniform(0, 1, count)
    pulls[np.arange(count), second] = np.where(rng.random(count) < 0.5, rng.uniform(0, 1, count), 0.0)
    idle = pulls == 0
    commands = chain.straight_lengths - pulls * deepest + idle * others_pay_out * chain.length
    return gravity, commands


def _gravity_vectors(values: np.ndarray) -> np.ndarray:
    """Gravity, m/s² (N, 3), from the inputs of the network for it, (N, 0, 1 or 3)."""
    return gravity_of(np.pad(values, [(0, 0), (0, len(POSE))]))


@dataclass
class Reached:
    """How N targets were met by the commands for them.

    Attributes:
        position: distance of the tip from its target at the end, m; NaN where MuJoCo found none. Shape (N,).
        doubtful: where the answer said so. Shape (N,).
        seconds: until the tip stayed near its end; NaN where it was not looked at or never did. Shape (N,).
        rested: whether the arm was at rest at the end; None where nobody looked. Shape (N,).
    """

    position: np.ndarray
    doubtful: np.ndarray
    seconds: np.ndarray
    rested: np.ndarray | None = None

    def __getitem__(self, rows) -> "Reached":
        rested = None if self.rested is None else self.rested[rows]
        return Reached(self.position[rows], self.doubtful[rows], self.seconds[rows], rested)

    def missed(self, length: float) -> np.ndarray:
        """By how much each target was missed, m; one without an end counts as missed by the arm's `length`, m. (N,)."""
        return np.where(np.isfinite(self.position), self.position, length)

    def metrics(self, length: float) -> dict:
        """Summary, of targets as `missed` has them."""
        position = self.missed(length)
        far = position > SHARE * length
        return {
            "position_error_mm": {
                "median": np.median(position) * 1e3,
                "p95": np.quantile(position, 0.95) * 1e3,
                "max": position.max() * 1e3,
            },
            "median_interval_mm": median_interval(position * 1e3),
            "beyond_1pct": int(far.sum()),
            "beyond_1pct_unsaid": int((far & ~self.doubtful).sum()),
            "doubted": float(self.doubtful.mean()),
        } | self._at_rest()

    def _at_rest(self) -> dict:
        """Of rest, what was looked at."""
        share = {} if self.rested is None else {"rested": float(self.rested.mean())}
        return share | ({"seconds_to_rest": self.time_to_rest()} if np.isfinite(self.seconds).any() else {})

    def time_to_rest(self) -> dict:
        """Median and 95th percentile, s; what never rested counts as longer than all others."""
        seconds = np.where(np.isfinite(self.seconds), self.seconds, np.inf)
        # between two infinities, nothing is interpolated
        quantiles = np.quantile(seconds, (0.5, 0.95), method="higher")
        return {name: v if np.isfinite(v) else None for name, v in zip(("median", "p95"), quantiles, strict=True)}


def score(
    model: mujoco.MjModel,
    chain: Chain,
    ask: Ask,
    sampled: np.ndarray,
    deepest: np.ndarray,
    settings: AsControls,
    rng: np.random.Generator,
) -> tuple[dict, Drawn, Reached]:
    """The network's commands as sent, without and with friction, and for shapes that the data set has none of.

    "frictionless": drawn in slowly, damped. "friction": sent at once to the model as it is. Where that has no friction,
    it is damped after SWING s, all but the timed ones; "dry_friction" says what it has, at most.

    Args:
        ask: the network, targets to its answer.
        sampled, deepest: as in `draw_targets`.

    Returns:
        Metrics, the targets, and how the first of them were met with friction.
    """
    drawn = draw_targets(model, chain, sampled, PULL_SHARE * deepest, settings.targets, rng)
    taut = draw_targets(model, chain, sampled, TAUT_SHARE * deepest, settings.targets // 8, rng, others_pay_out=False)
    targets = drawn.targets
    timed = driven(model, ask, targets[: settings.timed], settings.seconds, friction=False, calm=True)
    if has_friction(model):
        sent = driven(model, ask, targets[: settings.sent], settings.seconds)
        seconds = sent.time_to_rest()
    else:  # all drives are without: those that were timed are the first of them
        parts = [timed]
        if len(targets) > settings.timed:
            parts.append(driven(model, ask, targets[settings.timed :], SWING, friction=False, calm=True))
        sent = Reached(**{name: np.concatenate([vars(part)[name] for part in parts]) for name in vars(timed)})
        seconds = timed.time_to_rest()
    tendons, joints = model_friction(model)
    arm = ArmModel(model)
    dry = {"tendons_n": tendons.max(), "joints_nm": joints.max(), "sliders": len(arm.sliders)}
    dry |= {"capstan": arm.capstan_friction, "backlash_m": arm.backlash}
    on_model = {
        **drawn.counts(),
        "frictionless": settled(model, ask, targets).metrics(chain.length) | {"seconds_to_rest": timed.time_to_rest()},
        "friction": {
            "targets": len(sent.position),
            **sent.metrics(chain.length),
            "seconds_to_rest": seconds,
            "dry_friction": dry,
        },
        "all_taut": taut.counts() | settled(model, ask, taut.targets).metrics(chain.length),
    }
    return on_model, drawn, sent


def median_interval(values: np.ndarray) -> list[float]:
    """The 95 % interval of the median of what `values` (N,) are drawn from: two of them, by their ranks."""
    low, high = binom.ppf([0.025, 0.975], len(values), 0.5).astype(int)
    ordered = np.sort(values)
    return [float(ordered[max(low - 1, 0)]), float(ordered[min(high, len(values) - 1)])]


def settled(model: mujoco.MjModel, ask: Ask, targets: np.ndarray) -> Reached:
    """The commands of the network for `targets`, each at rest without friction."""
    answer = ask(targets)
    rest = settle(model, answer["commands"][:, model.actuator_trnid[:, 0]], gravity_of(targets))
    return replace(reached(targets, answer, rest.position), rested=rest.rested)


def driven(
    model: mujoco.MjModel, ask: Ask, targets: np.ndarray, seconds: float, friction: bool = True, calm: bool = False
) -> Reached:
    """The commands of the network for `targets`, sent at once to the straight arm, which moves as it does.

    With `calm`, what still moves after so many seconds is damped until it rests: not with friction.
    """
    answer = ask(targets)
    commands, gravity = answer["commands"][:, model.actuator_trnid[:, 0]], gravity_of(targets)
    motion = drive(model, commands, gravity, seconds, friction, calm=calm)
    return replace(reached(targets, answer, motion.end), seconds=motion.seconds_to_rest, rested=motion.rested)


def reached(targets: np.ndarray, answer: dict[str, np.ndarray], tips: np.ndarray) -> Reached:
    """How `targets` were met by tips (N, 3), m, in the base frame, of the network's `answer` for them."""
    position = np.linalg.norm(tips - position_of(targets), axis=1)
    nothing = np.full(len(targets), np.nan)
    return Reached(position, answer["doubtful"], nothing)
