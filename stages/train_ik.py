"""Train the inverse kinematics network, score it by forward kinematics, and export it as ONNX."""

from pathlib import Path

import onnx
import torch

from trunkline.files import file_digest
from trunkline.kinematics.dataset.samples import read_samples
from trunkline.kinematics.ik.inputs import inputs_of
from trunkline.kinematics.ik.learn import Learning, learn
from trunkline.kinematics.ik.on_plant import Rig
from trunkline.kinematics.ik.onnx import TrialsAtRest
from trunkline.kinematics.ik.report import histogram, summary
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import read_chain
from trunkline.model_files import read_model
from trunkline.pipeline.inputs import load_rig
from trunkline.pipeline.stage import output_folder, run_stage, write_metrics
from trunkline.recordings.trials.conditions import conditions_of
from trunkline.recordings.trials.splits import DECIDING
from trunkline.recordings.trials.trial import read_trials
from trunkline.report.figures.network import error_map_figure, learning_figure, tip_error_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import settings
from trunkline.twin.discrepancy import FILE, read_lacking

SAMPLES = Path("data/processed/fk_dataset/samples.parquet")
TRIALS = Path("data/processed/filter")
ARTIFACTS, LACKING = Path("artifacts/train_ik"), Path("artifacts") / FILE


@settings
class Config(Learning):
    """See conf/train_ik/config.yaml. model: MJCF file of the arm."""

    model: str


def main(config: Config) -> None:
    model = read_model(Path(config.model))
    ArmModel(model).require_lengths("train_ik.model")
    chain = read_chain(model).smooth
    table = read_samples(SAMPLES, chain.tendons, "split")
    rig = None
    if config.rig is not None:
        reach = load_rig("train_ik.rig", config.rig)
        rig = Rig(reach, conditions_of(read_trials(TRIALS, DECIDING)).pulls)
    inputs = inputs_of(table)
    lacking = read_lacking(LACKING, file_digest(Path(config.model)))
    at_rest = lacking and TrialsAtRest(
        chain.straight_lengths, lacking.sure_pulls, lacking.tilt_deg, lacking.pulled_tilt_deg, lacking.residual_map
    )
    learned = learn(model, chain, table, config, rig, at_rest)

    with output_folder(ARTIFACTS) as folder:
        onnx.save(learned.exported, str(folder / "ik.onnx"))
        state = {"state": learned.network.state_dict(), "width": config.width, "inputs": inputs}
        torch.save(state, folder / "checkpoint.pt")
        learned.curve.to_csv(folder / "learning_curve.csv", index=False, float_format="%.6g")
        histogram(learned.errors).to_csv(folder / "tip_error.csv", index=False, float_format="%.6g")
        save_figure(learning_figure(learned.curve), folder / "learning_curve.png")
        positions = {name: error.position for name, error in learned.errors.items()}
        save_figure(tip_error_figure(positions, chain.length), folder / "tip_error.png")
        located = learned.held_out.assign(error_mm=positions["held out"] * 1e3)
        save_figure(error_map_figure(located), folder / "error_map.png")
        write_metrics(folder, summary(learned, chain.length))


if __name__ == "__main__":
    run_stage("train_ik", Config, main)
