"""Training of the network on the tip error to first order: Adam, each batch in parts that cores share."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import torch
from pydantic import Field
from torch.optim.adam import adam

from trunkline.errors import InputError
from trunkline.ik.network import InverseKinematics
from trunkline.ik.tip_loss import TipLoss
from trunkline.settings import Seed
from trunkline.threads import thread_count

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
        inputs: Shape (N, 8).
        commands, lengths: m, equal where a tendon is slack. Shape (N, K).
        report: called with epoch, mean tip error in m of the training and of the other samples.

    Raises:
        InputError: the error is no longer finite.
    """
    torch.set_num_threads(1)
    torch.manual_seed(training.seed)
    network = InverseKinematics(training.width, inputs[is_train], commands[is_train], lengths[is_train])
    parameters: list[torch.Tensor] = list(network.parameters())
    pose = torch.tensor(inputs, dtype=torch.float32)
    x, angle, tip = network.normalise(pose), pose[:, :1], pose[:, 1:4]
    command = torch.tensor(commands, dtype=torch.float32)
    stretch = torch.tensor(lengths - commands, dtype=torch.float32)
    pulls = (command - network.middle) / network.half_range
    most_spare = torch.tensor(SLACK * (lengths <= commands), dtype=torch.float32) / network.half_range
    rows = torch.tensor(np.flatnonzero(is_train))
    others = torch.tensor(np.flatnonzero(~is_train))
    shuffle = torch.Generator().manual_seed(training.seed)
    batches = len(rows) // training.batch
    steps = max(1, training.epochs * batches)
    # for the function behind torch.optim.Adam: the class imports torch's compiler, which takes seconds
    first, second = ([torch.zeros_like(parameter) for parameter in parameters] for _ in range(2))
    counts = [torch.zeros(()) for _ in parameters]

    def slopes(part: torch.Tensor, spare: torch.Tensor) -> tuple[tuple[torch.Tensor, ...], torch.Tensor]:
        """Gradient of the objective on these rows, summed over them, and their tip errors, m."""
        commands, stretches = network.unclipped(x[part])
        delta = commands - command[part]
        moved = loss(part, delta)
        size = (moved.square().sum(dim=1) + ROUNDING**2).sqrt()
        missed = network.foresee(angle[part], pulls[part] + spare * most_spare[part]) - tip[part]
        foreseen = (missed.square().sum(dim=1) + ROUNDING**2).sqrt()
        stretched = (stretches - stretch[part]).abs().mean(dim=1)
        objective = (size + foreseen + TIE * delta.abs().mean(dim=1) + STRETCH * stretched).sum()
        return torch.autograd.grad(objective, parameters), moved.detach()[:, :3].norm(dim=1)

    @torch.no_grad()
    def tip_error(part: torch.Tensor) -> torch.Tensor:
        return loss(part, network.unclipped(x[part])[0] - command[part])[:, :3].norm(dim=1)

    done = 0
    with ThreadPoolExecutor(min(PARTS, thread_count()), initializer=torch.set_num_threads, initargs=(1,)) as pool:
        for epoch in range(1, training.epochs + 1):
            total = 0.0
            order = rows[torch.randperm(len(rows), generator=shuffle)]
            for batch in order[: batches * training.batch].split(training.batch):
                spare = torch.rand(len(batch), most_spare.shape[1], generator=shuffle)
                gradients, errors = zip(*pool.map(slopes, batch.chunk(PARTS), spare.chunk(PARTS)), strict=True)
                summed = [sum(parts, torch.zeros(())) / len(batch) for parts in zip(*gradients, strict=True)]
                speed = training.learning_rate * rate(done / steps)
                with torch.no_grad():
                    adam(parameters, summed, first, second, [], counts, lr=speed, **ADAM)
                done += 1
                total += float(torch.cat(errors).mean())
            if not np.isfinite(total):
                raise InputError(
                    f"train_ik.learning_rate: found {training.learning_rate}, by which the tip error is not finite in"
                    f" epoch {epoch}, expected a smaller one"
                )
            validate = torch.cat(list(pool.map(tip_error, others.split(4096))))
            report(epoch, total / batches, float(validate.mean()))
    return network.eval()


def rate(done: float) -> float:
    """The learning rate over the largest, when a share `done` of all steps is: up evenly, down along a cosine."""
    if done < WARM_UP:
        return done / WARM_UP
    return 0.001 + 0.999 * (1 + np.cos(np.pi * (done - WARM_UP) / (1 - WARM_UP))) / 2
