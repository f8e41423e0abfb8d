"""What every choice of model and method is worth: a Markdown table of errors on trials that no fit saw.

    python -m studies.choices [--only NAME ...]

Needs the trials and the CAD model of the demo session (`make demo`). Each row changes one thing in the settings of
params.yaml and conf/, runs the three stages one after the other, each on what the one before it found, and scores the
last model on the `validate` split. CPU time is that of all threads in a stage's search, without reading trials. What
physics is worth: `python -m studies.effects`.

A row is kept in docs/results/choices.csv as soon as it is done; stopped, the study goes on from there. The table is
kept once it is whole. Progress goes to stderr.
"""

import argparse
import sys
from dataclasses import dataclass, field, replace

from studies.rows import Rows, digest
from studies.stage_chain import STAGES, StageChain, committed, require_demo, run_stages
from trunkline.errors import in_one_line
from trunkline.identification.evaluation.evaluation import replay, scores
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.simulate.loss import Loss
from trunkline.model_files import read_spec
from trunkline.pipeline.config import PROJECT
from trunkline.pipeline.identify import CAD_MODEL, TRIALS
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.recordings.trials.trial import Trial
from trunkline.settings import read_yaml

JOINT_FRICTION = Bounds(low=1e-4, high=0.1)  # rad of a joint's own spring
MOUNT = Bounds(low=-0.1, high=0.1)  # rad by which the mount is turned in the tracked base frame
COMMAND_DELAY = 0.02  # s
KINDS = ("release", "curl")
ERRORS = {"E_internal": "e_internal_mm", "position": "e_position_mm", "tip": "e_tip_mm"}


@dataclass
class ModelChoice:
    """A row. changes, parameters: in the settings of `stage`, of every one if it is "". loss: its file in
    conf/shared/loss/, for all. moving: trials begin with the velocity that the arm has in the frame of its start pose,
    in place of none."""

    title: str
    stage: str = ""
    changes: dict = field(default_factory=dict)
    parameters: dict[str, Bounds] = field(default_factory=dict)
    loss: str = ""
    moving: bool = False

    def settings(self, stage: str) -> IdentificationSettings:
        """Those of a stage."""
        config = committed(stage)
        if self.loss:
            numbers = read_yaml(PROJECT / f"conf/shared/loss/{self.loss}.yaml")
            config = replace(config, loss=Loss(**{str(key): value for key, value in numbers.items()}))
        if self.stage in ("", stage):
            config = replace(config, parameters=config.parameters | self.parameters, **self.changes)
        return config

    def trials(self, trials: list[Trial]) -> list[Trial]:
        """As they are changed for it."""
        if not self.moving:
            return trials
        return [replace(trial, in_motion=not is_static(trial.experiment)) for trial in trials]


CHOICES: dict[str, ModelChoice] = {
    "committed": ModelChoice("as committed"),
    "joint-friction": ModelChoice(
        "with joint_friction", "identify_damping", parameters={"joint_friction": JOINT_FRICTION}
    ),
    "delay": ModelChoice(f"command_delay {COMMAND_DELAY:g} s", changes={"command_delay": COMMAND_DELAY}),
    # only the tendons' directions determine the twist
    "mount": ModelChoice("with mount_twist", "identify_control", parameters={"mount_twist": MOUNT}),
    "markers": ModelChoice("markers: measured", "identify_stiffness", {"markers": "measured"}),
    "velocity": ModelChoice("started with measured velocities", moving=True),
    "distances": ModelChoice("loss: distances", loss="distances"),
    "joint-damping": ModelChoice("per_joint damping too", "identify_damping", {"per_joint": ["damping"]}),
}


def cells(choice: ModelChoice, chains: dict[str, StageChain]) -> dict[str, float]:
    """Of a row, by their heads."""
    cad = "CAD", read_spec(CAD_MODEL).compile()
    chain = run_stages(cad, choice.settings, chains, choice.trials)
    unseen = [e for e in chain.experiments if e.split == VALIDATE]
    replayed = replay(chain.model, unseen, chain.fit.markers)
    table = scores(replayed, unseen, chain.fit.loss, chain.fit.weights)[VALIDATE]["by_experiment"]
    errors = {f"{error}, {kind}s (mm)": table[kind][key] for error, key in ERRORS.items() for kind in KINDS}
    stages = [stage.removeprefix("identify_") for stage in STAGES]
    return errors | {f"CPU {stage} (s)": seconds for stage, seconds in zip(stages, chain.spent, strict=True)}


def table_of(rows: dict[str, dict]) -> str:
    """Of the rows, in the order of CHOICES."""
    compared = {name: rows[name] for name in CHOICES if name in rows}
    heads = [head for head in next(iter(compared.values())) if head.endswith(")")]
    lines = [f"| choice | {' | '.join(heads)} |", "|---|" + "---:|" * len(heads)]
    for name, row in compared.items():
        values = [f"{row[head]:.0f}" if head.endswith("(s)") else f"{row[head]:.3f}" for head in heads]
        lines.append(f"| {CHOICES[name].title} | {' | '.join(values)} |")
    return "\n".join(lines)


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.choices", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=CHOICES, default=list(CHOICES), help="some of the rows")
    arguments = parser.parse_args()
    require_demo(CAD_MODEL)
    chains: dict[str, StageChain] = {}
    table = Rows("choices", digest([committed(stage) for stage in STAGES], CAD_MODEL, TRIALS), "name")
    with table.recorded({*table.read(), *arguments.only} >= set(CHOICES)):
        for name in [name for name in arguments.only if name not in table.read()]:
            table.add(name, **cells(CHOICES[name], chains))
        print(table_of(table.read()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
