"""From samples to a network that is trained, exported and scored by forward kinematics."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import mujoco
import numpy as np
import onnx
import onnxruntime
import pandas as pd
import torch
from pydantic import Field

from trunkline.compute.progress import progress
from trunkline.frames import downwards
from trunkline.kinematics.dataset.columns import command_columns, length_columns, tension_columns
from trunkline.kinematics.dataset.sampling import sections
from trunkline.kinematics.dataset.table import command_by_tension, sample_table, tip_by_tension, turn_by_tension
from trunkline.kinematics.ik.as_controls import DOUBT, AsControls, score
from trunkline.kinematics.ik.inference import ask
from trunkline.kinematics.ik.inputs import draw_gravity, gravity_columns, gravity_of, inputs_of, position_of
from trunkline.kinematics.ik.network import OUTPUTS, InverseKinematics
from trunkline.kinematics.ik.on_plant import Rig, record, score_on_plant
from trunkline.kinematics.ik.onnx import TrialsAtRest, to_onnx
from trunkline.kinematics.ik.refine import refine
from trunkline.kinematics.ik.score import (
    TipErrors,
    beyond_range,
    largest_difference,
    length_errors,
    outside_targets,
    tip_errors,
)
from trunkline.kinematics.ik.tip_loss import tip_loss
from trunkline.kinematics.ik.training import Training, train
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses
from trunkline.model.statics.chain import Chain

RECORDED = 30  # poses that a lab may record, by which the network is scored on its arm beside itself
FALSE_ALARMS = 0.05  # of reachable targets, that may be doubted


@dataclass
class Unseen:
    """Targets between the gravities of the data set: of how many, where there is more than a tilt; pulls around the
    arm, tips along each, how many in all. Without gravity, targets that are drawn anew."""

    gravities: Annotated[int, Field(ge=1, le=10_000)]
    directions: Annotated[int, Field(ge=8, le=10000)]
    steps: Annotated[int, Field(ge=8, le=10_000)]
    samples: Annotated[int, Field(ge=100, le=1_000_000)]


@dataclass
class AnswerRefinement:
    """Gauss-Newton from the network's answers: for how many held-out targets, and of how many steps at most."""

    targets: Annotated[int, Field(ge=1, le=1_000_000)]
    steps: Annotated[int, Field(ge=1, le=100)]


@dataclass(kw_only=True)
class Learning(Training):
    """The training and what it is scored on, see conf/train_ik/config.yaml.

    lever: m; the loss counts a turn of the tip by 1 rad as this much distance. outside: targets far off.
    rig: module whose `reach` drives the arm itself, as `on_plant.Rig`; none for an arm that no module drives.
    """

    lever: Annotated[float, Field(ge=0, le=1)]
    unseen: Unseen
    as_controls: AsControls
    polish: AnswerRefinement
    outside: Annotated[int, Field(ge=1, le=1_000_000)]
    rig: str | None


@dataclass
class Learned:
    """A network, also as ONNX, and its learning curve: epoch, train_mm, validate_mm.

    held_out: the samples that no training saw. errors: of the exported network's commands, for them ("held out") and
    for targets under "unseen angles". as_lengths: of its lengths, for the latter, held by cables. as_controls: what
    comes of its commands in MuJoCo, on_plant: on the arm itself. refined: of some held-out targets after Gauss-Newton
    steps. All of that but on_plant is of the network alone; moved: with the residual map, of the tip that it moves.
    outside: how many targets far off there are, beyond_range: how far (m) any answer to them leaves the tendons' range.
    difference: between the network and what was exported, m, at most.
    """

    network: InverseKinematics
    exported: onnx.ModelProto
    curve: pd.DataFrame
    held_out: pd.DataFrame
    errors: dict[str, TipErrors]
    as_lengths: TipErrors
    as_controls: dict
    on_plant: dict | None
    refined: TipErrors
    moved: TipErrors | None
    outside: int
    beyond_range: float
    difference: float


def learn(
    model: mujoco.MjModel, chain: Chain, table: pd.DataFrame, learning: Learning, rig: Rig | None = None,
    at_rest: TrialsAtRest | None = None,
) -> Learned:  # fmt: skip
    """Train on the samples of `table` that are not held out, and score on those that are and on others.

    Args:
        model: whose `chain` it is. rig: what drives the arm itself. at_rest: None where no certificate was made.
    """
    network, curve = fit(table, chain, learning)
    columns = inputs_of(table)
    held_out = table[table["split"] == "validate"]
    sampled = sampled_gravities(table)
    sent_before = table.loc[table["split"] == "train", command_columns(chain.tendons)].to_numpy()
    deepest = chain.straight_lengths - sent_before.min(axis=0)
    between = unseen_targets(chain, sampled, learning.unseen, learning.seed, deepest)
    doubtful = doubt_beyond(network, held_out[columns].to_numpy(), chain.length)
    export = partial(to_onnx, network, [model.tendon(t).name for t in range(chain.tendons)], doubtful)
    exported = of_twin = export(at_rest and replace(at_rest, residual_map=None))
    runtime, moved = _session(of_twin), None
    if at_rest and at_rest.residual_map is not None:
        exported = export(at_rest)
        moved = moved_errors(chain, at_rest.residual_map, between, _session(exported))
    errors, difference, answers = {}, 0.0, {}
    for name, targets in (("held out", held_out), ("unseen angles", between)):
        inputs = targets[columns].to_numpy()
        answers = ask(runtime, inputs)
        with torch.no_grad():
            outputs = network(torch.tensor(inputs, dtype=torch.float32))._asdict()
        difference = max(difference, *(largest_difference(answers[key], outputs[key].numpy()) for key in OUTPUTS))
        print(f"train_ik: forward kinematics of {len(inputs)} answers, {name}", flush=True)
        errors[name] = tip_errors(chain, inputs, answers["commands"].astype(float))
    as_lengths = length_errors(chain, between[columns].to_numpy(), answers["lengths"].astype(float))
    refined = refined_errors(chain, held_out[columns], runtime, learning.polish, learning.seed)
    rng = np.random.default_rng(learning.seed)
    far = ask(runtime, outside_targets(learning.outside, chain.length, rng, sampled.shape[1]))["commands"]
    print("train_ik: sending commands to MuJoCo until the arm rests", flush=True)
    network_answer = partial(ask, runtime)
    as_controls, drawn, sent = score(model, chain, network_answer, sampled, deepest, learning.as_controls, rng)
    on_plant = None
    if rig is not None:
        few = slice(learning.as_controls.on_rig)
        twin = np.quantile(sent.missed(chain.length)[few], (0.5, 0.95)) * 1e3
        others, poses = {}, slice(learning.as_controls.on_rig, learning.as_controls.on_rig + RECORDED)
        if exported is of_twin and (learnt := record(model, chain, drawn.targets[poses], drawn.commands[poses], rig)):
            nothing = TrialsAtRest(chain.straight_lengths, 0.0, 0.0, 0.0)
            with_poses = _session(export(replace(at_rest or nothing, residual_map=learnt)))
            others = {"with_poses": partial(ask, with_poses)}
        shipped = partial(ask, _session(exported))
        on_plant = score_on_plant(model, chain, shipped, drawn.targets[few], drawn.commands[few], rig, others)
        on_plant["twin_mm"] = {"median": twin[0], "p95": twin[1]}
    return Learned(
        network=network,
        exported=exported,
        curve=curve,
        held_out=held_out,
        errors=errors,
        as_lengths=as_lengths,
        as_controls=as_controls,
        on_plant=on_plant,
        refined=refined,
        moved=moved,
        outside=len(far),
        beyond_range=beyond_range(far, sent_before),
        difference=difference,
    )


def fit(table: pd.DataFrame, chain: Chain, learning: Learning) -> tuple[InverseKinematics, pd.DataFrame]:
    """The trained network and its learning curve: epoch, train_mm, validate_mm."""
    tendons = chain.tendons
    turn = learning.lever * turn_by_tension(table, tendons)
    loss = tip_loss(
        table[tension_columns(tendons)].to_numpy(),
        np.concatenate([tip_by_tension(table, tendons), turn], axis=1),
        command_by_tension(table, chain.gain),
    )
    curve = []
    with progress(learning.epochs, "train_ik", "epochs") as bar:

        def report(epoch: int, train_error: float, validate_error: float) -> None:
            curve.append({"epoch": epoch, "train_mm": train_error * 1e3, "validate_mm": validate_error * 1e3})
            bar.update(1, **{k: v for k, v in curve[-1].items() if k != "epoch"})

        network = train(
            table[inputs_of(table)].to_numpy(),
            table[command_columns(tendons)].to_numpy(),
            table[length_columns(tendons)].to_numpy(),
            loss,
            (table["split"] == "train").to_numpy(),
            learning,
            report,
        )
    return network, pd.DataFrame(curve)


def doubt_beyond(network: InverseKinematics, reachable: np.ndarray, length: float) -> float:
    """How far from its target a foreseen tip is a reason to doubt, m: DOUBT of the arm's `length`, and no less than
    leaves all but FALSE_ALARMS of `reachable` targets (N, 7, 8 or 10) without doubt."""
    with torch.no_grad():
        tips = network(torch.tensor(reachable, dtype=torch.float32)).tip.numpy()
    missed = np.linalg.norm(tips - position_of(reachable), axis=1)
    return max(DOUBT * length, float(np.quantile(missed, 1 - FALSE_ALARMS)))


def moved_errors(
    chain: Chain, learnt: ResidualMap, targets: pd.DataFrame, runtime: onnxruntime.InferenceSession
) -> TipErrors:
    """Errors of a network with the residual map `learnt`, as the twin's tip moves by it, for samples moved by it."""
    inputs = targets[inputs_of(targets)].to_numpy()
    sent, gravity = targets[command_columns(chain.tendons)].to_numpy(), gravity_of(inputs)
    position_of(inputs)[:] += learnt.mean(RestingPoses.of_commands(chain, sent, gravity))
    return tip_errors(chain, inputs, ask(runtime, inputs)["commands"].astype(float), learnt)


def _session(exported: onnx.ModelProto) -> onnxruntime.InferenceSession:
    return onnxruntime.InferenceSession(exported.SerializeToString(), providers=["CPUExecutionProvider"])


def refined_errors(chain: Chain, held_out: pd.DataFrame, runtime, settings: AnswerRefinement, seed: int) -> TipErrors:
    """Errors of some held-out targets after Gauss-Newton steps from the network's answers."""
    count = min(settings.targets, len(held_out))
    inputs = held_out.sample(count, random_state=seed).to_numpy()
    print(f"train_ik: up to {settings.steps} Gauss-Newton steps for {count} answers", flush=True)
    answer = {name: values.astype(float) for name, values in ask(runtime, inputs).items()}
    commands = answer["commands"] if len(sections(chain)) > 1 else None
    refined = refine(chain, inputs, answer["lengths"], settings.steps, commands=commands)
    return TipErrors(refined.position_error, refined.orientation_error)


def sampled_gravities(table: pd.DataFrame) -> np.ndarray:
    """The gravity inputs of the samples, each once. Shape (G, 0, 1 or 3)."""
    columns = inputs_of(table)
    rows = table.drop_duplicates(columns[:-7]) if columns[:-7] else table[:1]
    return gravity_columns(rows[columns].to_numpy())


def unseen_targets(
    chain: Chain, sampled: np.ndarray, unseen: Unseen, seed: int, deepest: np.ndarray | None = None
) -> pd.DataFrame:
    """Targets under gravities that the data set has none of, unlike `sampled` (G, 0, 1 or 3): half way between
    its angles, or at random. `deepest` as for `sample_table`."""
    rng = np.random.default_rng(seed)
    if sampled.shape[1] == 0:
        between = np.zeros((1, 3))
    elif sampled.shape[1] == 1:
        angles = np.sort(sampled[:, 0])
        between = downwards((angles[1:] + angles[:-1]) / 2, np.zeros(len(angles) - 1))
    else:
        between = draw_gravity(sampled, unseen.gravities, rng)
    count = unseen.samples // max(1, len(between))
    tables = [
        sample_table(chain, down, count, unseen.directions, unseen.steps, rng, deepest)[0] for down in between
    ]
    return pd.concat(tables, ignore_index=True)
