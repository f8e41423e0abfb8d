"""How good the twin of an arm is that nobody designs for: `python -m studies.families [--open N] [--sealed N]`

Arms of families with laws that the model has not are drawn (demo/families.py): open ones from plain seeds, N a family,
and sealed ones from the digest of the code, which nobody can tune to, N in all, the families in turn. Each records the
committed lab's experiments in a temporary folder, and the project's own stages identify it there with the settings of
params.yaml. Prints the errors of the final model on the trials of `test`, which the stage `score` reads, as mean over
arms and of the worst arm, and how many of the parameters' intervals hold the truth.

An arm takes some ten minutes and is kept in docs/results/families.csv as soon as it is done; stopped, the study goes on
from there. Progress goes to stderr.
"""

import argparse
import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd
from omegaconf import OmegaConf

from demo.families import draw_arm, families, sealed_seed
from studies.recovery import run
from studies.rows import Rows, digest
from trunkline.errors import InputError, in_one_line
from trunkline.identification.stages import STAGES
from trunkline.pipeline.config import PROJECT
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import TEST
from trunkline.settings import read_yaml
from upkeep.truth_table import TRUTH, expectation, holds, identified

PIPELINE = ("ingest", "filter", "build_mjcf", *STAGES, "score")
EVERY = "every"  # trial, of all kinds
FINER = (1, 2, 4)  # times as many steps of the simulated arm: stiff draws diverge with the family's


def arms(code: str, open_arms: int, sealed: int) -> dict[str, tuple[str, int]]:
    """Family and seed of each arm, by its name. code: digest."""
    names = list(families())
    chosen = {f"{family} {seed}": (family, seed) for family in names for seed in range(1, open_arms + 1)}
    for index in range(sealed):
        family = names[index % len(names)]
        chosen[f"{family} sealed {index + 1}"] = family, sealed_seed(code, family, index + 1)
    return chosen


def set_up(folder: Path, family: str, seed: int, finer: int = 1) -> None:
    """Write the settings of an arm's lab and of the stages into `folder`. finer: times as many steps of the simulated
    arm as its family has."""
    lab_seed, plant = draw_arm(family, seed)
    plant["substeps"] *= finer
    write_settings(folder, {"seed": lab_seed, "plant": family})
    OmegaConf.save(OmegaConf.create(plant), folder / f"demo/conf/record/plant/{family}.yaml")


def write_settings(folder: Path, lab: dict[str, int | str]) -> None:
    """The project's into `folder`, but the last model is scored on every kind of trial. lab: what of the simulated
    lab's is another."""
    shutil.copytree(PROJECT / "demo/conf", folder / "demo/conf", dirs_exist_ok=True)
    record = OmegaConf.merge(OmegaConf.load(PROJECT / "demo/params.yaml"), {"record": lab})
    OmegaConf.save(record, folder / "demo/params.yaml")
    settings = OmegaConf.masked_copy(read_yaml(PROJECT / "params.yaml"), list(PIPELINE))
    settings.ingest.session = "demo"
    settings[STAGES[-1]].reported = list(EXPERIMENTS)
    OmegaConf.save(settings, folder / "params.yaml")
    OmegaConf.save({"stages": {name: {} for name in PIPELINE}}, folder / "dvc.yaml")


def cells(folder: Path) -> dict[str, float | str]:
    """Of the arm in `folder`: errors of its final model in % of its length, by kind of trial, those of the null model,
    and of how many parameters that have a truth the interval holds it."""
    scored = json.loads((folder / "artifacts/score/metrics.json").read_text(encoding="utf-8"))[STAGES[-1]]
    row: dict[str, float | str] = {}
    for model, end in (("identified", ""), ("null", "_null")):
        errors = scored[model][TEST]
        for kind, of in {EVERY: errors, **errors["by_experiment"]}.items():
            row |= {f"{kind}{end}_{error}": of[f"e_{error}_pct"] for error in ("position", "tip")}
    truth = json.loads((folder / TRUTH).read_text(encoding="utf-8"))
    verdicts = [holds(table, expectation(truth, name)) for name, table in identified(folder).items()]
    decided = [verdict for verdict in verdicts if verdict is not None]
    return row | {"held": sum(decided), "intervals": len(decided), "refused": "no"}


def record(folder: Path, family: str, seed: int) -> None:
    """Set up an arm and record it, with finer steps where its simulation diverges.

    Raises:
        InputError: it does with the finest too.
    """
    for finer in FINER:
        set_up(folder, family, seed, finer)
        try:
            return run("demo.record", folder)
        except InputError:
            if finer == FINER[-1]:
                raise


def measure(family: str, seed: int) -> dict[str, float | str]:
    """Record, identify and score an arm. Where a stage refuses its session, the stage's name in place of errors."""
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        record(Path(name), family, seed)
        return identified_cells(Path(name)) | {"seconds": time.perf_counter() - begun}


def identified_cells(folder: Path) -> dict[str, float | str]:
    """Identify and score the session in `folder`: as `cells`, or what stage refuses it."""
    for stage in PIPELINE:
        try:
            run(f"stages.{stage}", folder)
        except InputError:
            return {"held": 0, "intervals": 0, "refused": stage}
    return cells(folder)


def family_table(rows: list[dict]) -> str:
    """Errors by family and kind of trial, those of all arms last, and the parameters' intervals below. Arms whose
    session was refused have no errors."""
    every = pd.DataFrame(rows)
    table = every[every["refused"] == "no"]
    words = {kind: of.plural for kind, of in EXPERIMENTS.items()} | {EVERY: "all"}
    lines = ["| family | arms | trials of `test`, final model | position (%): mean | worst arm | tip (%): mean "
             "| worst arm | null model, tip (%): mean |", "|---|---:|---|---:|---:|---:|---:|---:|"]  # fmt: skip
    for family, of in [*table.groupby("family", sort=False), (EVERY, table)]:
        for kind in [kind for kind in words if f"{kind}_tip" in of]:
            errors = [pd.to_numeric(of[f"{kind}_{error}"]) for error in ("position", "tip")]
            numbers = [f"{number:.3g}" for error in errors for number in (error.mean(), error.max())]
            cell = f"{pd.to_numeric(of[f'{kind}_null_tip']).mean():.3g}"
            lines.append(f"| {family} | {len(of)} | {words[kind]} | {' | '.join([*numbers, cell])} |")
    holding, intervals, seconds = (int(every[name].sum()) for name in ("held", "intervals", "seconds"))
    worst = ""
    if len(table):
        least = table.loc[(table["held"] / table["intervals"]).idxmin()]
        worst = f"; worst arm {int(least['held'])} of {int(least['intervals'])} ({least['arm']})"
    refused = [f"{row['arm']} by {row['refused']}" for row in rows if row["refused"] != "no"]
    return "\n".join([
        *lines,
        *([f"Sessions that are refused, and shall not be: {', '.join(refused)}."] if refused else []),
        f"95 % intervals of parameters that hold the truth: {holding} of {intervals}{worst}.",
        f"{(every['sealed'] == 'yes').sum()} of {len(every)} arms sealed; {seconds / 60 / len(every):.0f} min an arm.",
    ])  # fmt: skip


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.families", description=__doc__)
    parser.add_argument("--open", type=int, default=2, help="arms of each family from plain seeds")
    parser.add_argument("--sealed", type=int, default=5, help="arms in all from the digest of the code")
    args = parser.parse_args()
    table = Rows("families", digest("test, final model", Path("demo/families.yaml")), "arm")
    assert table.origin is not None
    chosen = arms(table.origin.digest, args.open, args.sealed)
    with table.recorded(keep=True):
        for name, (family, seed) in chosen.items():
            if name not in table.read():
                table.add(name, family=family, sealed="yes" if "sealed" in name else "no", **measure(family, seed))
        rows = table.read()
        print(family_table([rows[name] for name in chosen]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
