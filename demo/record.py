"""Record the demo session: simulate the experiments, look at them through the lab's instruments, write the logs,
and beside them the truth."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from demo.answers import parameters, start_in_log
from demo.experiments import PLANS, Experiments
from demo.instruments import InstrumentSettings, measure
from demo.laboratory import SAMPLE_RATE, Motors, record
from demo.plant import PlantSettings, build_plant
from demo.recorder import write_log, write_session
from trunkline.arm.mjcf import unit_name
from trunkline.arm.spiral import spiral_chain
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.progress import progress
from trunkline.settings import Seed, settings
from trunkline.trials.recording import Planned
from trunkline.trials.splits import IDENTIFY, VALIDATE

SESSION = Path("data/raw/demo")
ANSWERS = SESSION.with_name("demo.truth.json")  # beside the session, not in it: no stage depends on it


@dataclass
class Arm:
    length: Annotated[float, Field(ge=0.01, le=10)]
    base_width: Annotated[float, Field(gt=0, le=2)]
    tip_width: Annotated[float, Field(gt=0, le=2)]
    units: Annotated[int, Field(ge=1, le=500)]
    tendons: Annotated[int, Field(ge=3, le=12)]  # fewer cannot bend the arm to every side
    tracked: Annotated[list[Annotated[int, Field(ge=1, le=500)]], Field(min_length=1)]


@settings
class Config:
    seed: Seed
    arm: Arm
    plant: PlantSettings
    motors: Motors
    experiments: Experiments
    instruments: InstrumentSettings

    def __post_init__(self):
        arm, tests = self.arm, self.experiments
        _expect(arm.tip_width < arm.base_width, "arm.tip_width", arm.tip_width, f"less than {arm.base_width}")
        tracked = max(arm.tracked) <= arm.units and _distinct(arm.tracked)
        _expect(tracked, "arm.tracked", arm.tracked, f"distinct units from 1 to {arm.units}")
        for group in [*tests.curl_tendons, *tests.test.curl_tendons]:
            known = max(group) <= arm.tendons and _distinct(group)
            _expect(known, "experiments.curl_tendons", group, f"distinct tendons from 1 to {arm.tendons}")
        steps = 1 / (SAMPLE_RATE * self.plant.timestep)
        whole = round(steps) >= 1 and abs(steps - round(steps)) < 1e-6
        _expect(whole, "plant.timestep", self.plant.timestep, f"{1 / SAMPLE_RATE:g} s or a whole fraction of it")
        shortest, longest = self.instruments.occlusion_ms
        _expect(shortest <= longest, "instruments.occlusion_ms", [shortest, longest], "the shortest first")
        _expect(any(self.instruments.up), "instruments.up", list(self.instruments.up), "a direction")
        for key, plan in PLANS.values():
            _check_trials(f"experiments.{key}", plan(tests), plan(tests.tested()), tests)


def _check_trials(key: str, trials: list[Planned], tested: list[Planned], experiments: Experiments) -> None:
    names = [trial.name for trial in trials + tested]
    _expect(_distinct(names), key, _repeated(names), "a log of its own for each trial (names hold whole numbers)")
    splits = {trial.split for trial in trials}
    every = experiments.validate_every
    expected = f"trials of {key} in the splits {IDENTIFY} and {VALIDATE}"
    _expect(len(splits) == 2, "experiments.validate_every", every, expected)


def _expect(holds: bool, key: str, found, expected: str) -> None:
    if not holds:
        raise ValueError(f"{key}: found {found}, expected {expected}")


def _distinct(values: list) -> bool:
    return len(set(values)) == len(values)


def _repeated(values: list) -> str:
    return next((f"{value!r} twice" for value in values if values.count(value) > 1), "no repetition")


def main(config: Config) -> None:
    arm = config.arm
    plant_rng, lab_rng, instrument_rng, test_rng = np.random.default_rng(config.seed).spawn(4)
    chain = spiral_chain(arm.length, arm.base_width, arm.tip_width, arm.units)
    plant = build_plant(chain, config.plant, arm.tendons, plant_rng)
    tracked = [unit_name(number - 1) for number in arm.tracked]
    truths = record(plant, config.motors, config.experiments, arm.tendons, tracked, lab_rng, test_rng)
    measurements, starts, start = [], {}, 0.0
    with output_folder(SESSION) as folder, progress(len(truths), "record", "logs") as bar:
        for truth, rng in zip(truths, instrument_rng.spawn(len(truths)), strict=True):
            measurements.append(measure(truth, config.instruments, rng, start))
            if truth.begin:
                starts[truth.name] = start_in_log(truth, measurements[-1], start, config.instruments)
            start += truth.time[-1] + config.instruments.pause_s
            write_log(folder / f"{truth.name}.mcap", measurements[-1])
            bar.update(1, log=truth.name)
        write_session(folder, measurements, config.instruments)
    answers = parameters(chain, config.plant, plant) | {
        "clock_offset_s": config.instruments.clock_offset_s,
        "starts_s": starts,
    }
    write_json(ANSWERS, answers)


if __name__ == "__main__":
    run_stage("record", Config, main, root="demo")
