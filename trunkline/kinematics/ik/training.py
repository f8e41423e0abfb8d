"""Training of the network on the tip error to first order: Adam, each batch in parts that cores share."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import torch
from pydantic import Field
from torch import nn
from torch.optim.adam import adam

from trunkline.compute.threads import thread_count
from trunkline.errors import InputError
from trunkline.kinematics.ik.inputs import position_of
from trunkline.kinematics.ik.network import InverseKinematics, gravity_features
from trunkline.kinematics.ik.tip_loss import TipLoss
from trunkline.settings import Seed

ROUNDING = 0.5e-3  # m, tip errors well under this count by their square, larger ones by their size
TIE = 0.02  # weight of plain command errors, which alone tie down how long a slack tendon is
STRETCH = 1.0  # weight of errors of the lengths over the commands
SLACK = 1e-3  # m, most by which slack tendons are paid out where the tip is foreseen: that moves it nowhere
WARM_UP = 0.1  # share of the steps in which the learning rate rises from zero, while Adam learns each weight's scale
ADAM = {  # its usual numbers
    "beta1": 0.9, "beta2": 0.999, "eps": 1e-8, "weight_decay": 0.0, "amsgrad": False, "maximize": False, "fused": True,
}  # fmt: skip
PARTS = 2  # of a batch, whose gradients are summed in this order whatever thread found them: more cores, same network


@dataclass
class Training:
    """Attributes: width: of the hidden layers; epochs; batch: samples; learning_rate: the largest, after a warm-up,
    from which a cosine takes it to a thousandth; seed: of weights and shuffling."""

    width: Annotated[int, Field(ge=1, le=4096)]
    epochs: Annotated[int, Field(ge=1, le=10_000)]
    batch: Annotated[int, Field(ge=1, le=1_000_000)]
    learning_rate: Annotated[float, Field(gt=0, le=1)]
    seed: Seed


class TrainingSamples(NamedTuple):
    """What training reads of N samples.

    x: normalised features (N, 13, 15 or 55). pulling: what `network.gravity_features` says (N, 0, 2 or 3).
    tip: m (N, 3). command: m (N, K). stretch: length over command, m (N, K). pulls: commands as shares of their range
    (N, K). spare: most by which slack tendons are paid out where the tip is foreseen, likewise (N, K).
    """

    x: torch.Tensor
    pulling: torch.Tensor
    tip: torch.Tensor
    command: torch.Tensor
    stretch: torch.Tensor
    pulls: torch.Tensor
    spare: torch.Tensor
    loss: TipLoss

    def at(self, rows: torch.Tensor | slice) -> "TrainingSamples":
        """Of these samples alone."""
        return self._replace(**{name: part[rows] for name, part in self._asdict().items()})


def samples(
    network: InverseKinematics, inputs: np.ndarray, commands: np.ndarray, lengths: np.ndarray, loss: TipLoss
) -> TrainingSamples:
    """Arguments as those of `train`."""
    pose, command = torch.tensor(inputs, dtype=torch.float32), torch.tensor(commands, dtype=torch.float32)
    return TrainingSamples(
        x=network.normalise(pose),
        pulling=gravity_features(pose),
        tip=torch.tensor(position_of(inputs), dtype=torch.float32),
        command=command,
        stretch=torch.tensor(lengths - commands, dtype=torch.float32),
        pulls=(command - network.middle) / network.half_range,
        spare=torch.tensor(SLACK * (lengths <= commands), dtype=torch.float32) / network.half_range,
        loss=loss,
    )


def train(
    inputs: np.ndarray,
    commands: np.ndarray,
    lengths: np.ndarray,
    loss: TipLoss,
    is_train: np.ndarray,
    training: Training,
    report: Callable[[int, float, float], None],
) -> InverseKinematics:
    """Train on the samples where `is_train`, with Adam, on the tip error to first order.

    One thread a part of a batch: sums in another order would give other last digits, and then other networks.

    Args:
        inputs: as `inputs` has them. Shape (N, 7, 8 or 10).
        commands, lengths: m, equal where a tendon is slack. Shape (N, K).
        report: called with epoch, mean tip error in m of the training and of the other samples.

    Raises:
        InputError: the error is no longer finite.
    """
    torch.set_num_threads(1)
    torch.manual_seed(training.seed)
    network = InverseKinematics(training.width, inputs[is_train], commands[is_train], lengths[is_train])
    parameters: list[torch.Tensor] = list(network.parameters())
    data = samples(network, inputs, commands, lengths, loss)
    rows = torch.tensor(np.flatnonzero(is_train))
    others = data.at(torch.tensor(np.flatnonzero(~is_train)))
    shuffle = torch.Generator().manual_seed(training.seed)
    batches = len(rows) // training.batch
    steps = max(1, training.epochs * batches)
    # for the function behind torch.optim.Adam: the class imports torch's compiler, which takes seconds
    first, second = ([torch.zeros_like(parameter) for parameter in parameters] for _ in range(2))
    counts = [torch.zeros(()) for _ in parameters]

    def slopes(part: TrainingSamples, spare: torch.Tensor) -> tuple[tuple[torch.Tensor, ...], torch.Tensor]:
        """Gradient of the batch's mean objective as far as these samples make it, and the sum of their tip errors."""
        commands, stretches = network.unclipped(part.x)
        delta = commands - part.command
        moved = part.loss(delta)
        missed = network.foresee(part.pulling, part.pulls + spare * part.spare) - part.tip
        plain = (TIE * delta.abs() + STRETCH * (stretches - part.stretch).abs()).sum() / delta.shape[1]
        objective = (rounded(moved).sum() + rounded(missed).sum() + plain) / training.batch
        return torch.autograd.grad(objective, parameters), moved.detach()[:, :3].norm(dim=1).sum()

    @torch.no_grad()
    def tip_error(part: TrainingSamples) -> torch.Tensor:
        return part.loss(network.unclipped(part.x)[0] - part.command)[:, :3].norm(dim=1)

    done, size = 0, -(-training.batch // PARTS)
    with ThreadPoolExecutor(min(PARTS, thread_count()), initializer=torch.set_num_threads, initargs=(1,)) as pool:
        for epoch in range(1, training.epochs + 1):
            total = 0.0
            order = data.at(rows[torch.randperm(len(rows), generator=shuffle)])  # in a row: batches are parts of it
            spares = torch.rand(len(rows), data.spare.shape[1], generator=shuffle)
            for batch in pieces(batches * training.batch, training.batch):
                parts = [slice(batch.start + p.start, batch.start + p.stop) for p in pieces(training.batch, size)]
                results = pool.map(slopes, [order.at(part) for part in parts], [spares[part] for part in parts])
                (gradient, error), *rest = results
                for more, further in rest:
                    for mine, other in zip(gradient, more, strict=True):
                        mine += other
                    error += further
                speed = training.learning_rate * rate(done / steps)
                with torch.no_grad():
                    adam(parameters, list(gradient), first, second, [], counts, lr=speed, **ADAM)
                done += 1
                total += float(error) / training.batch
            if not np.isfinite(total):
                raise InputError(
                    f"train_ik.learning_rate: found {training.learning_rate}, by which the tip error is not finite in"
                    f" epoch {epoch}, expected a smaller one"
                )
            errors = pool.map(tip_error, map(others.at, pieces(len(others.x), 4096)))
            validate = torch.cat(list(errors))
            report(epoch, total / batches, float(validate.mean()))
    return network.eval()


def rounded(errors: torch.Tensor) -> torch.Tensor:
    """√(|e|² + ROUNDING²) of errors (N, D). As a norm, since PyTorch's square root (MKL) is another in its last digit
    on each kind of processor."""
    return torch.linalg.vector_norm(nn.functional.pad(errors, (0, 1), value=ROUNDING), dim=1)


def pieces(count: int, size: int) -> list[slice]:
    """Of range(count), each of `size` but the last one."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]


def rate(done: float) -> float:
    """The learning rate over the largest, when a share `done` of all steps is: up evenly, down along a cosine."""
    if done < WARM_UP:
        return done / WARM_UP
    return 0.001 + 0.999 * (1 + np.cos(np.pi * (done - WARM_UP) / (1 - WARM_UP))) / 2
