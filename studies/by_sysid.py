"""Models of others of the real arms: `python -m studies.by_sysid [--only ftdcr]`

`mujoco.sysid`, MuJoCo's own search, descends from the values of an arm's description, on the same trials, residuals and
ranges as the stages of its example, stage after stage, with each of two sizes of its differences. A Markdown table of
its errors on `validate`, with which parameters it leaves where they were or on a bound; beside the identified model's,
the description's, null models', and what is published. Run the stages `filter` and `build_mjcf` of the examples first.
"""

import argparse
import json
import sys
from importlib import import_module
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.identification.case import Case
from benchmarks.identification.sysid import UNMOVED, by_sysid
from trunkline.errors import existing, in_one_line
from trunkline.identification.evaluation.evaluation import replay, scores
from trunkline.identification.fit.identify import values_of, with_parameters
from trunkline.identification.fit.linearisation import DIFFERENCE
from trunkline.identification.fit.setup import set_up, with_every
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.pipeline.config import load_config
from trunkline.pipeline.inputs import read_spec
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY, VALIDATE
from trunkline.recordings.trials.trial import read_trials
from upkeep.results import recorded

ARMS = {  # and the stages that identify each
    "asl_trunk": ("identify_stiffness", "identify_damping"),
    "asl_motion": ("identify_stiffness",),
    "ftdcr": ("identify_stiffness",),
}
STEPS = {"as it comes": {}, f"eps {DIFFERENCE:g}": {"eps": DIFFERENCE}}
BESIDE = {
    "identified": "identified",
    "cad": "the description",
    "null": "null: mean shape",
    "null_straight": "null: straight arm",
}
# The model, on what, RMS of the tip without mean offset in mm, whose.
PUBLISHED = {
    "asl_trunk": [],
    "asl_motion": [
        ("learnt: control-augmented spectral submanifold", "150 short pieces of motion of a later trunk, each from its"
         " measured state: not comparable", 2.8, "Wolff et al., arXiv 2603.23044, as an index of results has it"),
    ],
    "ftdcr": [
        ("the authors' simulator, calibrated", "train.csv", 6.68, "ContinuumRoboticsLab/opencr-mujoco"),
        ("the authors' simulator, calibrated", "val.csv", 9.38, "ContinuumRoboticsLab/opencr-mujoco"),
    ],
}  # fmt: skip
BUDGET = 300.0  # s of each search
ON_BOUND = 1e-3  # of the range


def rows(arm: str) -> list[str]:
    root, last = Path("examples") / arm, ARMS[arm][-1]
    known = json.loads(existing(root / "artifacts" / last / "metrics.json").read_text())
    lines = [_row(arm, name, known[key][VALIDATE]) for key, name in BESIDE.items()]
    for name, options in STEPS.items():
        errors, said = _descended(root, ARMS[arm], options)
        lines.insert(-3, _row(arm, f"`mujoco.sysid`, {name}", errors, said))
    return [
        *lines,
        *(f"| {arm} | {name} | {on} |  |  | {off:g} | {source} |" for name, on, off, source in PUBLISHED[arm]),
    ]


def _descended(root: Path, stages: tuple[str, ...], options: dict) -> tuple[dict, str]:
    """Errors on `validate` of the arm with what the search came to, and what it did not move or ran into."""
    model, said = read_spec(existing(root / "artifacts/build_mjcf/arm.xml")).compile(), []
    errors: dict = {}
    for stage in stages:
        case = _case(root, stage, model)
        rival = by_sysid(case, BUDGET, **options)
        assert rival.vector is not None
        said += _stalled(case, rival.vector)
        model = with_parameters(case.model, values_of(case.fit.parameters, rival.vector))
        replayed = replay(model, case.unseen, case.fit.segments)
        errors = scores(replayed, case.unseen, case.fit.loss, case.fit.weights)[VALIDATE]
    return errors, ", ".join(said)


def _case(root: Path, stage: str, model: mujoco.MjModel) -> Case:
    config = with_every(load_config(import_module(f"stages.{stage}").Config, stage, root), model)
    trials = [t for t in read_trials(root / "data/processed/filter", DECIDING) if t.experiment in config.reported]
    model, experiments, fit = set_up(config, trials, model)
    fitted = [e for e in experiments if e.kind in config.experiments and e.split == IDENTIFY]
    return Case(model, fitted, [e for e in experiments if e.split == VALIDATE], fit)


def _stalled(case: Case, vector: np.ndarray) -> list[str]:
    problem = case.problem()
    start, (low, high) = problem.start(), problem.bounds()
    lines = []
    for i, name in enumerate(case.fit.parameters):
        if min(vector[i] - low[i], high[i] - vector[i]) < ON_BOUND * (high[i] - low[i]):
            lines.append(f"{name} on a bound")
        elif abs(vector[i] - start[i]) < UNMOVED * (PARAMETERS[name].scale if PARAMETERS[name].signed else 1.0):
            lines.append(f"{name} unmoved")
    return lines


def _row(arm: str, name: str, errors: dict, said: str = "") -> str:
    centred = f"{errors['e_tip_centred_rms_mm']:.3g}" if "e_tip_centred_rms_mm" in errors else ""
    cells = (f"{errors['e_position_mm']:.3g} / {errors['e_tip_mm']:.3g}", f"{errors['e_position_pct']:.3g}", centred)
    return f"| {arm} | {name} | {VALIDATE} | {' | '.join(cells)} | {said} |"


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=ARMS)
    only = parser.parse_args().only
    with recorded("by_sysid", keep=not only):
        errors = "position / tip, mm | % of length | tip, RMS without mean offset, mm"
        print(f"| arm | model | on | {errors} | left, or source |")
        print("|---|---|---|---:|---:|---:|---|")
        for arm in [only] if only else ARMS:
            for line in rows(arm):
                print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
