"""Train the inverse kinematics network, score it by forward kinematics, and export it as ONNX."""

from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pandas as pd
import torch
from pydantic import Field, PositiveFloat, PositiveInt

from trunkline.dataset.table import (
    length_by_tension,
    length_columns,
    sample_table,
    tension_columns,
    tip_by_tension,
    turn_by_tension,
)
from trunkline.errors import InputError
from trunkline.figures.network import error_map_figure, learning_figure, tip_error_figure
from trunkline.figures.style import save_figure
from trunkline.ik.network import INPUTS, InverseKinematics
from trunkline.ik.onnx import OPSET, to_onnx
from trunkline.ik.polish import polish
from trunkline.ik.score import TipErrors, beyond_range, largest_difference, outside_targets, tip_errors
from trunkline.ik.tip_loss import tip_loss
from trunkline.ik.training import Training, train
from trunkline.pipeline.inputs import read_model
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.progress import progress
from trunkline.settings import settings
from trunkline.statics.chain import Chain, read_chain

MODEL = Path("artifacts/identify_control/arm.xml")
SAMPLES = Path("data/processed/fk_dataset/samples.parquet")
ARTIFACTS = Path("artifacts/train_ik")


@settings
class Unseen:
    directions: int = Field(ge=8)
    steps: int = Field(ge=8)
    samples: int = Field(ge=100)


@settings
class Polish:
    targets: int = Field(ge=1)
    steps: PositiveInt


@settings
class Config:
    width: PositiveInt
    epochs: PositiveInt
    seed: int = Field(ge=0)
    batch: PositiveInt
    learning_rate: PositiveFloat
    lever: float = Field(ge=0)
    unseen: Unseen
    polish: Polish
    outside: int = Field(ge=1)


def main(config: Config) -> None:
    model = read_model(MODEL)
    chain = read_chain(model)
    table = read_table(SAMPLES, chain.tendons)
    network, curve = fit(table, chain.tendons, config)
    held_out = table[table["split"] == "validate"]
    unseen = unseen_angles(chain, np.unique(table["theta_g"]), config)
    exported = to_onnx(network, [model.tendon(t).name for t in range(chain.tendons)])
    runtime = onnxruntime.InferenceSession(exported.SerializeToString(), providers=["CPUExecutionProvider"])
    errors, difference = {}, 0.0
    for name, targets in (("held out", held_out), ("unseen angles", unseen)):
        inputs = targets[INPUTS].to_numpy()
        lengths = answers(runtime, inputs)
        with torch.no_grad():
            torch_lengths = network(torch.tensor(inputs, dtype=torch.float32)).numpy()
        difference = max(difference, largest_difference(lengths, torch_lengths))
        print(f"train_ik: forward kinematics of {len(inputs)} answers, {name}", flush=True)
        errors[name] = tip_errors(chain, inputs, lengths.astype(float))
    exact = polished(chain, held_out, runtime, config)
    far = answers(runtime, outside_targets(config.outside, chain.length, np.random.default_rng(config.seed)))
    known = table.loc[table["split"] == "train", length_columns(chain.tendons)].to_numpy()

    with output_folder(ARTIFACTS) as folder:
        onnx.save(exported, str(folder / "ik.onnx"))
        torch.save({"state": network.state_dict(), "width": config.width, "inputs": INPUTS}, folder / "checkpoint.pt")
        curve.to_csv(folder / "learning_curve.csv", index=False, float_format="%.6g")
        located = held_out[INPUTS].assign(error_mm=errors["held out"].position * 1e3)
        histogram(errors).to_csv(folder / "tip_error.csv", index=False, float_format="%.6g")
        save_figure(learning_figure(curve), folder / "learning_curve.png")
        positions = {name: error.position for name, error in errors.items()}
        save_figure(tip_error_figure(positions, chain.length), folder / "tip_error.png")
        save_figure(error_map_figure(located), folder / "error_map.png")
        write_json(
            folder / "metrics.json",
            errors["held out"].metrics(chain.length)
            | {
                "unseen_angles": errors["unseen angles"].metrics(chain.length),
                "polished": exact.metrics(chain.length),
                "outside": {"targets": len(far), "beyond_range_m": beyond_range(far, known)},
                "onnx_max_abs_diff_m": difference,
                "opset": OPSET,
                "parameters": sum(p.numel() for p in network.parameters()),
            },
        )


def answers(runtime: onnxruntime.InferenceSession, inputs: np.ndarray) -> np.ndarray:
    """Lengths (N, K), m, that the exported network gives for `inputs` (N, 8)."""
    return runtime.run(None, {"pose": inputs.astype(np.float32)})[0]


def polished(chain: Chain, held_out: pd.DataFrame, runtime, config: Config) -> TipErrors:
    """Errors of some held-out targets after Gauss-Newton steps from the network's answers."""
    count = min(config.polish.targets, len(held_out))
    inputs = held_out[INPUTS].sample(count, random_state=config.seed).to_numpy()
    print(f"train_ik: up to {config.polish.steps} Gauss-Newton steps for {count} answers", flush=True)
    found = polish(chain, inputs, answers(runtime, inputs).astype(float), config.polish.steps)
    return TipErrors(found.position_error, found.orientation_error)


def read_table(path: Path, tendons: int) -> pd.DataFrame:
    """The samples of fk_dataset."""
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected the samples of the fk_dataset stage (run `dvc repro`)")
    table = pd.read_parquet(path)
    missing = [name for name in INPUTS + length_columns(tendons) + ["split"] if name not in table]
    if missing:
        raise InputError(f"{path}: found no column {missing[0]!r}, expected samples of an arm of {tendons} tendons")
    if table["theta_g"].nunique() < 2:
        raise InputError(f"{path}: found 1 gravity angle, expected at least 2: the network is tested between them")
    return table


def fit(table: pd.DataFrame, tendons: int, config: Config) -> tuple[InverseKinematics, pd.DataFrame]:
    """The trained network and its learning curve: epoch, train_mm, validate_mm."""
    turn = config.lever * turn_by_tension(table, tendons)
    loss = tip_loss(
        table[tension_columns(tendons)].to_numpy(),
        np.concatenate([tip_by_tension(table, tendons), turn], axis=1),
        length_by_tension(table, tendons),
    )
    curve = []
    with progress(config.epochs, "train_ik", "epochs") as bar:

        def report(epoch: int, train_error: float, validate_error: float) -> None:
            curve.append({"epoch": epoch, "train_mm": train_error * 1e3, "validate_mm": validate_error * 1e3})
            bar.update(1, **{k: v for k, v in curve[-1].items() if k != "epoch"})

        network = train(
            table[INPUTS].to_numpy(),
            table[length_columns(tendons)].to_numpy(),
            loss,
            (table["split"] == "train").to_numpy(),
            Training(config.width, config.epochs, config.batch, config.learning_rate, config.seed),
            report,
        )
    return network, pd.DataFrame(curve)


def unseen_angles(chain: Chain, angles: np.ndarray, config: Config) -> pd.DataFrame:
    """Targets at gravity angles half way between those of the data set."""
    between = (angles[1:] + angles[:-1]) / 2
    rng = np.random.default_rng(config.seed)
    count = config.unseen.samples // max(1, len(between))
    tables = [
        sample_table(chain, tilt, count, config.unseen.directions, config.unseen.steps, rng)[0] for tilt in between
    ]
    return pd.concat(tables, ignore_index=True)


def histogram(errors: dict[str, TipErrors]) -> pd.DataFrame:
    """Share of the targets in bins of tip error, per set of targets."""
    edges = np.geomspace(1e-2, 1e2, 41)
    rows = []
    for name, error in errors.items():
        position = np.nan_to_num(error.position * 1e3, nan=edges[-1])
        counts, _ = np.histogram(np.clip(position, edges[0], edges[-1]), edges)
        rows += [
            {"error_mm": middle, "targets_pct": 100 * n / len(position), "targets": name}
            for middle, n in zip(np.sqrt(edges[1:] * edges[:-1]), counts, strict=True)
        ]
    return pd.DataFrame(rows)


if __name__ == "__main__":
    run_stage("train_ik", Config, main)
