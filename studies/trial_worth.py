"""What each kind of trial is worth: `python -m studies.trial_worth`

Three arms record the simulated lab's whole session: the lab's arm, the matched plant, which shares the model's
structure, and one of a family whose laws the model has not. The project's stages identify each with all of its trials,
without those of one kind, and with the experiments of the paper's table alone. The trials of `test` stay, and score the
final model: as a table, errors on them by kind.

Without a kind of trial, `experiments` of the stages lack it; without static pulls, `source: tilts` and no parameter
that only pulls show, as the stage's message says. Releases are never left out, as damping comes from them alone. A row
takes some six minutes and is kept in docs/results/trial_worth.csv as soon as it is done; stopped, the study goes on
from there. Progress goes to stderr.
"""

import argparse
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

from omegaconf import OmegaConf

from studies.families import EVERY, identified_cells, record, write_settings
from studies.recovery import run
from studies.rows import Rows, digest
from trunkline.errors import in_one_line
from trunkline.identification.stages import STAGES
from trunkline.pipeline.config import PROJECT, settings_of
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import TEST
from trunkline.settings import read_yaml

SESSION = Path("data/raw/demo")
ARMS = {"the lab's": ("stranger", 7), "matched plant": ("cousin", 7), "helix 1": ("helix", 1)}  # plant or family, seed
LOADED = "loaded"  # trials, of any kind
LEFT_OUT = {
    "none": (),
    "static tilts": ("static_tilt",),
    "static pulls": ("static_pull",),
    "curls": ("curl",),
    "motions": ("motion",),
    "trials with a load": (LOADED,),
    "all but the paper's": ("static_pull", "motion", LOADED),
}
BY_PULLS = ("kp", "capstan_friction")  # of identify_stiffness: no static pull, nothing that says what they are
KINDS = ("static_tilt", "release", "curl", "static_pull", "motion")  # columns


def record_arm(folder: Path, plant: str, seed: int) -> None:
    """Set up an arm's lab and the stages in `folder`, and record the whole session."""
    if (PROJECT / f"demo/conf/record/plant/{plant}.yaml").is_file():
        write_settings(folder, {"plant": plant, "seed": seed})
        run("demo.record", folder)
    else:
        record(folder, plant, seed)


def leave_out(folder: Path, kinds: tuple[str, ...]) -> None:
    """Take trials of these kinds, but those of `test`, from the session in `folder`, and set what is needed then."""
    path = folder / SESSION / "session.yaml"
    session = read_yaml(path)
    for trial in list(session.trials):
        if trial.split != TEST and (trial.experiment in kinds or (LOADED in kinds and "load" in trial)):
            session.trials.remove(trial)
            (path.parent / trial.file).unlink()
    OmegaConf.save(session, path)
    settings = read_yaml(folder / "params.yaml")
    for stage in STAGES:
        experiments = settings_of(stage, folder).experiments
        if not set(experiments).isdisjoint(kinds):
            settings[stage].experiments = [kind for kind in experiments if kind not in kinds]
    if "static_pull" in kinds:
        settings.identify_stiffness.source = "tilts"
        for name in BY_PULLS:
            settings.identify_stiffness.parameters.pop(name)
    OmegaConf.save(settings, folder / "params.yaml")


def worth_table(rows: dict[str, dict]) -> str:
    """Errors of the final model on the trials of `test`, in % of the arm's length, by what was left out."""
    words = [EXPERIMENTS[kind].plural for kind in KINDS]
    lines = [f"| arm | left out | all | {' | '.join(words)} | intervals that hold |", f"|---|---|{'---:|' * 7}"]
    for name, row in rows.items():
        arm, left = name.split(": ")
        if row["refused"] != "no":
            lines.append(f"| {arm} | {left} | refused by {row['refused']} |{' |' * 6}")
            continue
        cells = [f"{float(row[f'{of}_position']):.3g} / {float(row[f'{of}_tip']):.3g}" for of in (EVERY, *KINDS)]
        holding = f"{int(row['held'])} of {int(row['intervals'])}"
        lines.append(f"| {arm} | {left} | {' | '.join(cells)} | {holding} |")
    minutes = statistics.mean(float(row["seconds"]) for row in rows.values()) / 60
    return "\n".join([*lines, f"Position / tip, % of length, mean over trials of `test`; {minutes:.0f} min a row."])


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.trial_worth", description=__doc__)
    parser.add_argument("--only", default="", help="rows whose name has this in it")
    args = parser.parse_args()
    rows = Rows("trial_worth", digest(f"{ARMS} {LEFT_OUT}", Path("demo/families.yaml")), "row")
    names = [f"{arm}: {left}" for arm in ARMS for left in LEFT_OUT]
    missing = [name for name in names if name not in rows.read() and args.only in name]
    with rows.recorded(keep=True):
        for arm, (plant, seed) in ARMS.items():
            of_arm = [name for name in missing if name.startswith(f"{arm}: ")]
            with tempfile.TemporaryDirectory() as recorded:
                if of_arm:
                    record_arm(Path(recorded), plant, seed)
                for name in of_arm:
                    begun = time.perf_counter()
                    with tempfile.TemporaryDirectory() as folder:
                        shutil.copytree(recorded, folder, dirs_exist_ok=True)
                        leave_out(Path(folder), LEFT_OUT[name.removeprefix(f"{arm}: ")])
                        row = identified_cells(Path(folder))
                    rows.add(name, **row, seconds=time.perf_counter() - begun)
        done = rows.read()
        print(worth_table({name: done[name] for name in names if name in done}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
