"""Record the demo session: simulate the experiments, look at them through the lab's instruments, write the logs,
and beside them the truth."""

from pathlib import Path

import numpy as np

from demo.answers import start_in_log
from demo.experiments import PLANS, Experiments, loaded_trials
from demo.instruments import InstrumentSettings, measure
from demo.laboratory import record
from demo.plants.choice import Choice, distinct, expect, plant_of
from demo.recorder import write_log, write_session
from trunkline.compute.progress import progress
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.recordings.trials.recording import PlannedTrial
from trunkline.recordings.trials.splits import IDENTIFY, VALIDATE
from trunkline.settings import settings

SESSION = Path("data/raw/demo")
ANSWERS = SESSION.with_name("demo.truth.json")  # beside the session, not in it: no stage depends on it


@settings
class Config(Choice):
    experiments: Experiments
    instruments: InstrumentSettings

    def __post_init__(self):
        super().__post_init__()
        arm, tests = self.arm, self.experiments
        for group in [*tests.curl_tendons, *tests.test.curl_tendons]:
            valid = max(group) <= arm.tendons and distinct(group)
            expect(valid, "experiments.curl_tendons", group, f"distinct tendons from 1 to {arm.tendons}")
        for key, pulls in (("experiments.pulls", tests.pulls), ("experiments.test.pulls", tests.test.pulls)):
            for pull in pulls:
                expect(len(pull.levels) == arm.tendons, key, pull.levels, f"a level for each of {arm.tendons} tendons")
        shortest, longest = self.instruments.occlusion_ms
        expect(shortest <= longest, "instruments.occlusion_ms", [shortest, longest], "the shortest first")
        expect(any(self.instruments.up), "instruments.up", list(self.instruments.up), "a direction")
        for key, plan in PLANS.values():
            if trials := plan(tests):
                _check_trials(f"experiments.{key}", trials, plan(tests.tested()), tests)
        loaded = [trial.name for trial in [*loaded_trials(tests), *loaded_trials(tests.tested())]]
        expect(distinct(loaded), "experiments.loads", _repeated(loaded), "a log of its own for each trial")


def _check_trials(key: str, trials: list[PlannedTrial], tested: list[PlannedTrial], experiments: Experiments) -> None:
    names = [trial.name for trial in trials + tested]
    expect(distinct(names), key, _repeated(names), "a log of its own for each trial (names hold whole numbers)")
    splits = {trial.split for trial in trials}
    every = experiments.validate_every
    expected = f"trials of {key} in the splits {IDENTIFY} and {VALIDATE}"
    expect(len(splits) == 2, "experiments.validate_every", every, expected)


def _repeated(values: list) -> str:
    return next((f"{value!r} twice" for value in values if values.count(value) > 1), "no repetition")


def main(config: Config) -> None:
    _, lab_rng, instrument_rng, test_rng = np.random.default_rng(config.seed).spawn(4)
    plant = plant_of(config)
    tracked = [number - 1 for number in config.arm.tracked]
    truths = record(plant, config.experiments, tracked, lab_rng, test_rng)
    measurements, starts, start = [], {}, 0.0
    with output_folder(SESSION) as folder, progress(len(truths), "record", "logs") as bar:
        for truth, rng in zip(truths, instrument_rng.spawn(len(truths)), strict=True):
            start -= min(truth.command_time, default=0.0)  # commands may come before the first frame
            measurements.append(measure(truth, config.instruments, rng, start))
            if truth.begin:
                starts[truth.name] = start_in_log(truth, measurements[-1], start, config.instruments)
            start += truth.time[-1] + config.instruments.pause_s
            write_log(folder / f"{truth.name}.mcap", measurements[-1])
            bar.update(1, log=truth.name)
        write_session(folder, measurements, config.instruments)
    lab = {"plant": config.plant.kind, "clock_offset_s": config.instruments.clock_offset_s, "starts_s": starts}
    write_json(ANSWERS, plant.answers() | lab)


if __name__ == "__main__":
    run_stage("record", Config, main, root="demo")
