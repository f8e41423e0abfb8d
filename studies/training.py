"""What width, epochs, batch and learning rate of the network's training are worth: a Markdown table.

    python -m studies.training [--targets N] WIDTH,EPOCHS,BATCH,LEARNING_RATE ...

for instance `256,100,512,2e-3 256,45,512,5e-3`. Needs the samples and the calibrated arm (`make demo`). Tip errors are
those after forward kinematics, of held-out samples and of targets under gravities that the data set has none of. Times
are of the training alone: CPU time of all threads, and wall time, which tells something on an idle machine only.
Progress goes to stderr.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from trunkline.errors import in_one_line
from trunkline.kinematics.dataset.columns import command_columns, length_columns, tension_columns
from trunkline.kinematics.dataset.table import command_by_tension, tip_by_tension, turn_by_tension
from trunkline.kinematics.ik.inputs import inputs_of
from trunkline.kinematics.ik.learn import Unseen, sampled_gravities, unseen_targets
from trunkline.kinematics.ik.score import tip_errors
from trunkline.kinematics.ik.tip_loss import tip_loss
from trunkline.kinematics.ik.training import Training, train
from trunkline.model.statics.chain import read_chain
from trunkline.pipeline.inputs import existing, read_model
from upkeep.results import recorded

MODEL = Path("artifacts/identify_control/arm.xml")
SAMPLES = Path("data/processed/fk_dataset/samples.parquet")
LEVER = 0.02  # m, as conf/train_ik/config.yaml has it
UNSEEN = Unseen(gravities=100, directions=24, steps=12, samples=2000)  # as well
TITLES = ["width", "epochs", "batch", "learning rate", "CPU (s)", "wall (s)"]
TITLES += [f"{name}, {what} (mm)" for name in ("held out", "unseen gravity") for what in ("median", "95 % below")]
TITLES += ["turn, median (°)"]


def setting(text: str) -> Training:
    """From four numbers, WIDTH,EPOCHS,BATCH,LEARNING_RATE."""
    width, epochs, batch, rate = text.split(",")
    return Training(int(width), int(epochs), int(batch), float(rate), 1)


def told(epoch: int, train_error: float, validate_error: float) -> None:
    print(f"{epoch:4d}: {1e3 * train_error:.3f} mm, {1e3 * validate_error:.3f} mm", file=sys.stderr)


@in_one_line
@recorded("training")
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("settings", type=setting, nargs="+")
    parser.add_argument("--targets", type=int, default=2000, help="of each kind (default: %(default)s)")
    arguments = parser.parse_args()
    chain = read_chain(read_model(MODEL)).smooth
    table = pd.read_parquet(existing(SAMPLES))
    tendons = chain.tendons
    pose = np.concatenate([tip_by_tension(table, tendons), LEVER * turn_by_tension(table, tendons)], axis=1)
    loss = tip_loss(table[tension_columns(tendons)].to_numpy(), pose, command_by_tension(table, chain.gain))
    inputs_read = inputs_of(table)
    unseen = unseen_targets(chain, sampled_gravities(table), replace(UNSEEN, samples=arguments.targets), 1)
    held_out = table[table["split"] == "validate"]
    targets = [held_out.sample(min(arguments.targets, len(held_out)), random_state=1), unseen]
    sets = (inputs_read, command_columns(tendons), length_columns(tendons))
    inputs, commands, lengths = (table[columns].to_numpy() for columns in sets)
    is_train = (table["split"] == "train").to_numpy()

    print("| " + " | ".join(TITLES) + " |\n" + "|---" * len(TITLES) + "|")
    for training in arguments.settings:
        cpu, wall = time.process_time(), time.perf_counter()
        network = train(inputs, commands, lengths, loss, is_train, training, told)
        cells = [training.width, training.epochs, training.batch, f"{training.learning_rate:g}"]
        cells += [f"{time.process_time() - cpu:.0f}", f"{time.perf_counter() - wall:.0f}"]
        for rows in targets:
            asked = rows[inputs_read].to_numpy()
            with torch.no_grad():
                answers = network(torch.tensor(asked, dtype=torch.float32)).commands.double().numpy()
            errors = tip_errors(chain, asked, answers).metrics(chain.length)
            cells += [f"{errors['position_error_mm'][key]:.3f}" for key in ("median", "p95")]
        cells.append(f"{errors['orientation_error_deg']['median']:.2f}")
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
