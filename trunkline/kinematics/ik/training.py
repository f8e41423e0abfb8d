"""Training of the network on the tip error to first order."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
import torch
from pydantic import Field
from pytorch_optimizer import SOAP
from torch.optim.lr_scheduler import CosineAnnealingLR, LinearLR, SequentialLR

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
WARM_UP = 0.1  # share of the steps in which the learning rate rises, while SOAP learns the gradients' scale
LOWEST = 1e-3  # learning rate at both ends over the largest


@dataclass
class Training:
    """Attributes: width: of the hidden layers; epochs; batch: samples; learning_rate: the largest, after a warm-up,
    from which a cosine takes it to a thousandth; seed: of weights and shuffling; device: where, "auto" for a card where
    there is one."""

    width: Annotated[int, Field(ge=1, le=4096)]
    epochs: Annotated[int, Field(ge=1, le=10_000)]
    batch: Annotated[int, Field(ge=1, le=1_000_000)]
    learning_rate: Annotated[float, Field(gt=0, le=1)]
    seed: Seed
    device: Literal["cpu", "cuda", "auto"] = "cpu"

    def torch_device(self) -> torch.device:
        """Raises: InputError: "cuda" without a card that torch can use."""
        available = torch.cuda.is_available()
        if self.device == "cuda" and not available:
            raise InputError("train_ik.device: found cuda, but torch sees no such card, expected cpu or auto")
        return torch.device("cuda" if available and self.device != "cpu" else "cpu")


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

    def to(self, device: torch.device) -> "TrainingSamples":
        return self._replace(**{name: part.to(device) for name, part in self._asdict().items()})

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
    """Train on the samples where `is_train`, with SOAP (Vyas et al. 2025), on the tip error to first order.

    The same machine and `TRUNKLINE_THREADS` give the same network; other ones sum in another order, so that last digits
    differ.

    Args:
        inputs: as `inputs` has them. Shape (N, 7, 8 or 10).
        commands, lengths: m, equal where a tendon is slack. Shape (N, K).
        report: called with epoch, mean tip error in m of the training and of the other samples.

    Raises:
        InputError: the error is no longer finite.
    """
    torch.set_num_threads(thread_count())
    torch.manual_seed(training.seed)
    network = InverseKinematics(training.width, inputs[is_train], commands[is_train], lengths[is_train])
    device = training.torch_device()
    data = samples(network, inputs, commands, lengths, loss).to(device)
    network = network.to(device)
    rows = torch.tensor(np.flatnonzero(is_train))
    others = data.at(torch.tensor(np.flatnonzero(~is_train)))
    shuffle = torch.Generator().manual_seed(training.seed)
    batches = len(rows) // training.batch
    optimizer = SOAP(network.parameters(), lr=training.learning_rate, weight_decay=0.0)
    schedule = warm_up_and_cosine(optimizer, training.epochs * batches)
    for epoch in range(1, training.epochs + 1):
        total = 0.0
        order = data.at(rows[torch.randperm(len(rows), generator=shuffle)])  # in a row: batches are parts of it
        spares = torch.rand(len(rows), data.spare.shape[1], generator=shuffle).to(device)
        for start in range(0, batches * training.batch, training.batch):
            batch = slice(start, start + training.batch)
            mean, tip = objective(network, order.at(batch), spares[batch])
            optimizer.zero_grad()
            mean.backward()
            optimizer.step()
            schedule.step()
            total += float(tip)
        if not np.isfinite(total):
            raise InputError(
                f"train_ik.learning_rate: found {training.learning_rate}, by which the tip error is not finite in"
                f" epoch {epoch}, expected a smaller one"
            )
        with torch.no_grad():
            deltas = network.unclipped(others.x)[0] - others.command
            report(epoch, total / batches, float(tip_distance(others.loss(deltas)).mean()))
    return network.cpu().eval()


def objective(
    network: InverseKinematics, batch: TrainingSamples, spare: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """What is minimised, the mean over a batch of B, and the mean tip error to first order, m.

    Args:
        spare: share of its `spare` by which each slack tendon is paid out where the tip is foreseen. Shape (B, K).
    """
    commands, stretches = network.unclipped(batch.x)
    delta = commands - batch.command
    moved = batch.loss(delta)
    missed = network.foresee(batch.pulling, batch.pulls + spare * batch.spare) - batch.tip
    plain = TIE * delta.abs().mean() + STRETCH * (stretches - batch.stretch).abs().mean()
    return rounded(moved).mean() + rounded(missed).mean() + plain, tip_distance(moved.detach()).mean()


def tip_distance(moved: torch.Tensor) -> torch.Tensor:
    """How far tips moved, m, of the changes of pose (N, D) of `TipLoss`. Shape (N,)."""
    return moved[:, :3].norm(dim=1)


def rounded(errors: torch.Tensor) -> torch.Tensor:
    """√(|e|² + ROUNDING²) of errors (N, D)."""
    return (errors.square().sum(dim=1) + ROUNDING**2).sqrt()


def warm_up_and_cosine(optimizer: torch.optim.Optimizer, steps: int) -> SequentialLR:
    """The learning rate over `steps`: up evenly to the optimizer's, then down along a cosine, from and to LOWEST."""
    rising = max(1, round(WARM_UP * steps))
    warm_up = LinearLR(optimizer, LOWEST, total_iters=rising)
    largest = float(optimizer.param_groups[0]["initial_lr"])
    cosine = CosineAnnealingLR(optimizer, max(1, steps - rising), eta_min=LOWEST * largest)
    return SequentialLR(optimizer, [warm_up, cosine], [rising])
