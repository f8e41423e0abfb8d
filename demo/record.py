"""Record the demo session: simulate the experiments, look at them through the lab's instruments, write the logs."""

from pathlib import Path

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt

from demo.instruments import InstrumentSettings, measure
from demo.laboratory import Experiments, Motors, record
from demo.plant import PlantSettings, build_plant
from demo.recorder import write_log, write_session
from trunkline.arm.mjcf import unit_name
from trunkline.arm.spiral import spiral_chain
from trunkline.config import settings
from trunkline.progress import progress
from trunkline.stage import output_folder, run_stage

SESSION = Path("data/raw/demo")


@settings
class Arm:
    length: PositiveFloat
    base_width: PositiveFloat
    tip_width: PositiveFloat
    units: PositiveInt
    tendons: int = Field(ge=2)
    tracked: list[PositiveInt]


@settings
class Config:
    seed: int
    arm: Arm
    plant: settings(PlantSettings)
    motors: settings(Motors)
    experiments: settings(Experiments)
    instruments: settings(InstrumentSettings)


def main(config: Config) -> None:
    arm = config.arm
    plant_rng, lab_rng, instrument_rng = np.random.default_rng(config.seed).spawn(3)
    chain = spiral_chain(arm.length, arm.base_width, arm.tip_width, arm.units)
    plant = build_plant(chain, config.plant, arm.tendons, plant_rng)
    tracked = [unit_name(number - 1) for number in arm.tracked]
    truths = record(plant, config.motors, config.experiments, arm.tendons, tracked, lab_rng)
    measurements, start = [], 0.0
    with output_folder(SESSION) as folder, progress(len(truths), "record", "logs") as bar:
        for truth, rng in zip(truths, instrument_rng.spawn(len(truths)), strict=True):
            measurements.append(measure(truth, config.instruments, rng, start))
            start += truth.time[-1] + config.instruments.pause_s
            write_log(folder / f"{truth.name}.mcap", measurements[-1])
            bar.update(1, log=truth.name)
        write_session(folder, measurements, config.instruments)


if __name__ == "__main__":
    run_stage("record", Config, main, root="demo")
