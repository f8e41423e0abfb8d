"""What sessions and models of others come to: `python -m studies.cases [--only CASE…]`

For each folder of ../shared/cases, which others' bug reports and files were rebuilt as, a row: its kind, what the file
has, what came of it when it was first tried, by its README, and what becomes of it now (tests/support/outside.py).
Where the right answer is what a fit tells, the project's own stages identify the arm in a temporary folder, with the
cases' common settings: what they tell stands beside the right value, and is kept in docs/results/cases.csv as soon as
it is there. Stopped, the study goes on from there. Progress goes to stderr.
"""

import argparse
import contextlib
import importlib
import os
import re
import sys
import tempfile
from pathlib import Path

from omegaconf import OmegaConf

from studies.rows import Rows, digest
from tests.support.folders import CASES
from tests.support.outside import COMMON, OUTCOMES, bench, outcome
from trunkline.errors import InputError, in_one_line
from trunkline.identification.evaluation.error_tables import number
from trunkline.identification.stages import stated_interval
from trunkline.pipeline.stage import run_stage
from trunkline.recordings.preparation.motive import main as import_motive
from upkeep.truth_table import identified

README = re.compile(
    r"[^:]+: (?P<has>.*?)(?: Command: .*?)? Happens(?: and right)?: (?P<was>.*?)"
    r"(?: Should happen: (?P<should>.*?) \[(?P<verdict>.*?); (?P<kind>.*?)(?:; source: .*)?\])?$"
)
TRUTH = {"stiffness": 0.9, "damping": 0.02, "kp": 4000.0, "time_constant": 0.05}
WITH, WITHOUT = "params_with_tendons.yaml", "params_without_tendons.yaml"
FITTED = {
    "00-honest": WITH,
    "00-honest-steps": WITH,
    "01-commands-on-change": WITH,
    "06-centimetres": WITHOUT,
    "11-each-pose-four-times": WITH,
    "15-motive-z-up": WITHOUT,
    "51-stamps-of-arrival": WITHOUT,
    "59-bursts-in-the-log": WITHOUT,
}
LONGEST = 300  # characters of a cell


def about(case: str) -> list[str]:
    """Kind, what the file has, and what came of it then, of a case's README."""
    match = README.match((CASES / case / "README.md").read_text(encoding="utf-8").strip().splitlines()[0])
    if match is None:
        raise InputError(f"{CASES / case}/README.md: found no `Happens:`, expected a line on what came of it")
    return [match["kind"] or "–", match["has"].strip(), match["was"].strip()]


def fit(case: str, params: str) -> str:
    """What the stages tell of the arm, each parameter with its interval, beside what is right."""
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(sys.stderr):
        folder = bench(Path(name), case, params)
        if exports := sorted(CASES.glob(f"{case}/*.csv")):
            (folder / "data/raw" / case).unlink()
            import_motive(["--session", str(folder / "data/raw" / case), *map(str, exports)])
        stages = map(str, OmegaConf.load(folder / "params.yaml"))
        with contextlib.chdir(folder):
            for stage in sorted(stages, key=lambda stage: stage != "build_mjcf"):
                try:
                    run(stage)
                except SystemExit:
                    return f"refused by {stage}"
        words = []
        for parameter, row in identified(folder).items():
            low, high = stated_interval(row) or (None, None)
            interval = "not determined" if row["undetermined"] else f"{number(low, 3)} … {number(high, 3)}"
            words.append(f"{parameter} {number(row['value'], 4)} ({interval}; right {TRUTH[parameter]:g})")
        return ", ".join(words)


def run(stage: str) -> None:
    """A stage, in this process; it ends with SystemExit where it refuses, having said why."""
    module = importlib.import_module(f"stages.{stage}")
    run_stage(stage, module.Config, module.main)


def cell(words: str) -> str:
    """As a table has it: on one line, without bars, and not too long."""
    line = " ".join(words.split()).replace("|", "/")
    return line if len(line) <= LONGEST else line[: LONGEST - 2].rstrip() + " …"


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.cases", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=FITTED, metavar="CASE", help="fit these alone, and keep no table")
    args = parser.parse_args()
    if not CASES.is_dir():
        raise InputError(f"{CASES}: no such folder, expected the cases")
    texts = [CASES / case / "README.md" for case in (COMMON, *OUTCOMES)]
    table = Rows("cases", digest(TRUTH, *texts), "case")
    for case in args.only or FITTED:
        if case not in table.read():
            print(f"{case}: identified", file=sys.stderr)
            table.add(case, fitted=fit(case, FITTED[case]))
    fits = {case: str(row["fitted"]) for case, row in table.read().items()}
    if args.only:
        print("\n".join(f"{case}: {fits[case]}" for case in args.only))
        return 0
    with table.recorded(keep=True):
        print("| case | kind | what the file has | when it was first tried | now | fitted now |")
        print("|---|---|---|---|---|---|")
        for case in OUTCOMES:
            with tempfile.TemporaryDirectory() as scratch:
                now = outcome(case, Path(scratch))
            print(f"| {' | '.join(map(cell, [case, *about(case), now, fits.get(case, '–')]))} |")
    return 0


if __name__ == "__main__":
    os.environ.setdefault("MPLBACKEND", "Agg")
    sys.exit(main())
