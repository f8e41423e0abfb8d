"""The last centimetre: the lab's arm corrected by its cameras, beside the open loop and the cameras' noise.

    python -m qualification.seen [--targets 200]

Targets are tips at which the arm itself rests ("own surface"), and such tips of the twin ("twin's surface": the arm's
lies beside it, and no command takes the tip across). Poses are drawn as `train_ik` draws them, with another seed: under
gravity from any side, and once more of an arm that hangs straight, as live sessions have it. The arm hangs with loose
cables, is sent the network's command by a ramp, and moves by itself until its cameras see it rest; then it is corrected
step by step from where it is. Errors are of the true tip; what the arm is sent is all that the cameras and the twin
know. Takes some twenty minutes.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime

from demo.plants.bench import COMMAND_RATE, LOOSE
from demo.plants.choice import plant_of
from demo.plants.stranger import Stranger
from demo.plants.stranger_kernel import simulate, tip
from demo.rig import ROOT, Config
from trunkline.ar.correction.correction import CorrectionSettings, TipCorrection
from trunkline.ar.correction.rest import WINDOW, RestWatch
from trunkline.compute.progress import progress
from trunkline.compute.threads import thread_count
from trunkline.errors import in_one_line
from trunkline.kinematics.dataset.columns import command_columns
from trunkline.kinematics.dataset.samples import read_samples
from trunkline.kinematics.ik.as_controls import draw_targets
from trunkline.kinematics.ik.inference import ask
from trunkline.kinematics.ik.inputs import gravity_of, position_of
from trunkline.kinematics.ik.learn import sampled_gravities
from trunkline.kinematics.ik.on_plant import across_surface
from trunkline.model.simulation.rest import base_frame
from trunkline.model.statics.chain import Chain, read_chain
from trunkline.model_files import read_model
from trunkline.pipeline.config import load_config
from upkeep.results import recorded

SEED = 52_001
ROWS = 16  # of commands for each sample of the cameras: 125 Hz
NOISE = 0.3e-3  # m, standard deviation per axis
RAMP, FIRST_RAMP = 0.5, 2.0  # s in which a correction, and the first command, are sent
PATIENCE = 20.0  # s after which an arm that does not rest is left alone
SHOWN = (0, 1, 2, 3, 5)  # corrections
TARGETS = 200
GOALS = {"median": {3: 2.5, 5: 1.5}, "95th percentile": {5: 8.0}}  # mm, after so many corrections
AWAY = 2e-3  # m farther from the target than before, by which no step shall lead
SAMPLES = Path("data/processed/fk_dataset/samples.parquet")
MODEL, NETWORK = Path("artifacts/identify_control/arm.xml"), "artifacts/train_ik/ik.onnx"


class ArmAtWork:
    """The stranger's arm as it moves by itself from one command to the next. Tips and gravity are in the base marker's
    frame. It begins with loose cables."""

    def __init__(self, plant: Stranger, gravity: np.ndarray) -> None:
        self._plant, self._gravity = plant, plant.mount.inv().apply(gravity)
        self._sent = np.full(plant.tendons, -LOOSE)
        self._state = plant._rest(self._gravity, 0.0, self._sent)

    def advance(self, pulls: np.ndarray, rows: int) -> np.ndarray:
        """The tip, m, after so many rows with these `pulls` (K,), m."""
        plant, sent = self._plant, np.tile(pulls, (rows, 1))
        nothing = np.empty((0, 0, 3)), np.empty((0, 0, 3, 3)), np.empty((0, plant.tendons))
        simulate(
            plant.links, self._state, self._gravity, 0.0, sent, np.zeros_like(sent), plant.straight, COMMAND_RATE,
            plant.settings.substeps, 0, 1.0, 1, 0, np.empty(0, int), np.empty(0), *nothing,
        )  # fmt: skip
        return plant.mount.apply(tip(plant.links, self._state))

    def bring(self, pulls: np.ndarray, ramp: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
        """Send `pulls` over `ramp` s and wait until the cameras see the tip at rest: the true tip, the measured one, m,
        and s since. NaN where it does not rest."""
        watch, begin, seconds, truths = RestWatch(), self._sent, 0.0, []
        while seconds < PATIENCE:
            seconds += ROWS / COMMAND_RATE
            now = begin + min(seconds / ramp, 1.0) * (pulls - begin)
            truths.append(self.advance(now, ROWS))
            if watch.observe(seconds, truths[-1] + NOISE * rng.standard_normal(3)) and seconds > ramp + WINDOW:
                self._sent = pulls
                return np.mean(truths[-round(WINDOW * COMMAND_RATE / ROWS) :], axis=0), watch.tip, seconds
        self._sent = pulls
        return np.full(3, np.nan), np.full(3, np.nan), seconds


@dataclass
class Corrected:
    """errors: m, of the true tip at each rest, first the open loop's; the last one where it stays. seconds: of each
    correction. reason: why it ended. rests: commands, m, and measured tips, m, in the model's base frame."""

    errors: list[float]
    seconds: list[float] = field(default_factory=list)
    reason: str = ""
    rests: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)


def correct(arm: ArmAtWork, chain: Chain, target: np.ndarray, commands: np.ndarray, frame, rng) -> Corrected:
    """Bring the tip to a target.

    Args:
        target: inputs of the network, in the model's base frame. commands: m (K,), to begin with. frame: `base_frame`.
    """
    origin, turn = frame
    gravity, goal = gravity_of(target[None])[0], position_of(target[None])[0]
    loop, result, sent = TipCorrection(chain, gravity, goal, commands, CorrectionSettings()), Corrected([]), None
    while sent is None or not np.array_equal(loop.commands, sent):
        sent = loop.commands
        truth, measured, seconds = arm.bring(chain.straight_lengths - sent, RAMP if result.errors else FIRST_RAMP, rng)
        result.seconds += [seconds] * bool(result.errors)
        result.errors.append(float(np.linalg.norm((truth - origin) @ turn - goal)))
        if not loop.ended and np.isfinite(measured).all():
            result.rests.append((sent, (measured - origin) @ turn))
            loop.measured(result.rests[-1][1])
        elif not loop.ended:
            loop.refuse("the arm does not rest")
    result.reason = loop.ended
    return result


def everyone(label: str, task: Callable[[int, np.random.Generator], Any], count: int) -> list:
    """`task` of each target, with a generator of its own."""
    with (
        redirect_stdout(sys.stderr),
        ThreadPoolExecutor(thread_count()) as pool,
        progress(count, label, "targets") as bar,
    ):
        jobs = [pool.submit(task, index, np.random.default_rng([SEED, index])) for index in range(count)]
        done = []
        for job in jobs:
            done.append(job.result())
            bar.update(1)
    return done


class DrawnPoses:
    """Poses of the demo session's twin, drawn as `train_ik` draws them, and the lab's arm to be brought there.

    frame: of the twin's mount, as `base_frame`. targets: inputs of the network. Shape (count, 8 or 10). commands: by
    which the twin rests there, m. Shape (count, K).
    """

    def __init__(self, count: int, rng: np.random.Generator, straight: bool = False) -> None:
        """straight: whether the arm hangs so, of the gravities in the data set."""
        model = read_model(MODEL)
        self.chain, self.frame = read_chain(model).smooth, base_frame(model)
        table = read_samples(SAMPLES, self.chain.tendons, "split")
        deepest = self.chain.straight_lengths - table[command_columns(self.chain.tendons)].to_numpy().min(axis=0)
        gravities = sampled_gravities(table)
        gravities = gravities[[np.argmin(gravities[:, 2])]] if straight else gravities
        drawn = draw_targets(model, self.chain, gravities, deepest, 2 * count, rng)
        self.targets, self.commands = drawn.targets[:count], drawn.commands[:count]
        assert len(self.targets) == count, "too few of the poses that were drawn are far from the motors' limit"
        plant = plant_of(load_config(Config, "record", ROOT))
        assert isinstance(plant, Stranger)
        self._plant = plant

    def hanging(self, index: int) -> ArmAtWork:
        """The lab's arm with loose cables, its mount as in that pose."""
        return ArmAtWork(self._plant, gravity_of(self.targets[[index]])[0] @ self.frame[1].T)

    def brought(self, index: int, noise: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
        """As `ArmAtWork.bring`, by that pose's commands."""
        return self.hanging(index).bring(self.chain.straight_lengths - self.commands[index], FIRST_RAMP, noise)


def measure(targets: int) -> None:
    network = partial(ask, onnxruntime.InferenceSession(NETWORK, providers=["CPUExecutionProvider"]))
    print(f"| targets | error, mm | after {' | '.join(map(str, SHOWN))} corrections | where it stays |")
    print(f"|---|---|{'---:|' * (len(SHOWN) + 1)}")
    for word, goals in GOALS.items():
        print(f"| goal | {word} | {' | '.join(f'{goals[count]:g}' if count in goals else '' for count in SHOWN)} | |")
    notes = []
    for words, straight in (("", False), (", hanging straight", True)):
        drawn = DrawnPoses(targets, np.random.default_rng(SEED), straight)
        chain, (origin, turn), twin, commands = drawn.chain, drawn.frame, drawn.targets, drawn.commands
        reached = twin.copy()
        tips = everyone(f"own tips{words}", lambda *pose, drawn=drawn: drawn.brought(*pose)[0], targets)
        position_of(reached)[:] = (np.array(tips) - origin) @ turn
        rested = np.isfinite(reached).all(axis=1)
        across = across_surface(chain, commands[rested], gravity_of(twin)[rested], position_of(reached - twin)[rested])
        for name, of in (("own surface", reached[rested]), ("twin's surface", twin)):
            indices = np.flatnonzero(rested) if of is not twin else np.arange(targets)
            answers = network(of)["commands"]

            def corrected(
                row: int, noise: np.random.Generator, drawn=drawn, of=of, indices=indices, answers=answers
            ) -> Corrected:
                return correct(drawn.hanging(indices[row]), drawn.chain, of[row], answers[row], drawn.frame, noise)

            results = everyone(f"{name}{words}", corrected, len(of))
            print("\n".join(rows(f"{name}{words}", results)))
            notes += summary(f"{name}{words}", results)
        notes.append(
            f"- {targets} poses{words}; at {(~rested).sum()} the arm itself does not rest. Across the twin's surface, "
            f"which no command mends: median {1e3 * np.nanmedian(across):.2f} mm."
        )
    noise = 1e3 * NOISE
    print("\n" + "\n".join(notes))
    print(f"Cameras: {noise:g} mm an axis, {noise / np.sqrt(COMMAND_RATE / ROWS):.2f} mm in the mean of 1 s.")


def rows(name: str, results: list[Corrected]) -> list[str]:
    """Of the table. An arm that stays earlier counts as it stays; one that does not rest, as worst of all."""
    errors = np.array([[r.errors[min(count, len(r.errors) - 1)] for count in (*SHOWN, len(r.errors))] for r in results])
    errors = 1e3 * np.where(np.isfinite(errors), errors, np.inf)
    words = {"median": 0.5, "95th percentile": 0.95, "worst": 1.0}
    values = {word: np.quantile(errors, share, axis=0, method="higher") for word, share in words.items()}
    return [f"| {name} | {word} | {' | '.join(f'{v:.2f}' for v in of)} |" for word, of in values.items()]


def summary(name: str, results: list[Corrected]) -> list[str]:
    """How far steps led away, how long they took, and how they ended."""
    away = np.array([max([b - a for a, b in pairwise(r.errors)], default=0.0) for r in results])
    seconds = np.concatenate([r.seconds for r in results])
    ends = Counter(r.reason.split(":")[-1].strip() for r in results)
    ended = ", ".join(f"{reason} {count}" for reason, count in ends.most_common())
    return [
        f"- {name}: largest step away from the target {1e3 * np.nanmax(away):.1f} mm, by more than {1e3 * AWAY:g} mm "
        f"{(away > AWAY).sum()} of {len(results)}; a correction takes {np.median(seconds):.1f} s (median), "
        f"{seconds.max():.1f} s at most; ended: {ended}."
    ]


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="qualification.seen", description=__doc__)
    parser.add_argument("--targets", type=int, default=TARGETS)
    args = parser.parse_args()
    with recorded("seen", keep=args.targets >= TARGETS):
        measure(args.targets)
    return 0


if __name__ == "__main__":
    sys.exit(main())
