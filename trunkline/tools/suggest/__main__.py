"""What to record next, without a fit: `trunkline suggest SESSION`

Ranks trials that a lab could record (tilts, releases, pulls, curls, motions, loads at the tip) by how much each is
expected to shrink what you care about, by its Fisher information on the twin: --for intervals (of the
parameters, the widest count most), tip (its uncertainty at rest over the workspace) or grasp (that of a wound up arm;
it stands in for the probability to hold an object, which is not computed). Each suggestion takes those before it as
recorded. Prints what each costs in minutes, how to record it, its entry of session.yaml, and the commands to run
afterwards. Writes nothing. Method and limits: docs/lab-tools.md.
"""

import argparse
import sys
from pathlib import Path

import mujoco

from trunkline.errors import InputError, in_one_line, nearest
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.fit.setup import check_parameters
from trunkline.identification.parameters.per_session import make_room, per_session_names
from trunkline.identification.stages import STAGES, final_model
from trunkline.model.arm.kinds import described_arm
from trunkline.model.arm_model import ArmModel
from trunkline.model.places import marker_places
from trunkline.pipeline.config import load_folder, own_or_project, settings_of
from trunkline.program import add_settings, command_parser
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial, sessions_of
from trunkline.settings import read_yaml
from trunkline.tools.evaluate.session import trials_of
from trunkline.tools.suggest.candidates import Candidate, candidates
from trunkline.tools.suggest.goals import GOALS, Goal, weights_for
from trunkline.tools.suggest.information import FRAMES, StageInformation, stage_information
from trunkline.tools.suggest.ranking import Suggestion, after_each, expected_loss, suggest
from trunkline.tools.suggest.settings import Recordable
from trunkline.tools.suggest.words import (
    TITLES,
    entry_lines,
    kind_lines,
    loss_words,
    table_lines,
    why_words,
    widest_words,
)
from trunkline.twin.twin import Twin

DESCRIBED = "as described in params.yaml, as no stage has identified one yet: suggestions are only as good as it is"
Stages = list[StageInformation]


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("suggest", __doc__)
    parser.add_argument("session", type=Path, metavar="SESSION",
                        help="folder of logs and session.yaml, or of filtered trials")  # fmt: skip
    parser.add_argument("--model", type=Path, metavar="MODEL",
                        help="MJCF of the twin; default: the pipeline's latest, else as described")  # fmt: skip
    parser.add_argument("--for", dest="goal", default="intervals", metavar="GOAL", help=", ".join(GOALS))
    parser.add_argument("--count", type=int, default=4, metavar="N", help="trials to suggest; default: 4")
    parser.add_argument("--only", nargs="+", default=[], metavar="KIND", help="of experiment that the lab can do")
    parser.add_argument("--per-minute", action="store_true", help="choose by gain a minute, not by gain a trial")
    parser.add_argument("--error", type=float, default=0.5, metavar="PERCENT",
                        help="by which the fitted model will be off, of a point's distance from the base")  # fmt: skip
    add_settings(parser, "describes arm and stages")
    args = parser.parse_args(arguments)
    _check(args)
    grid = load_folder(Recordable, own_or_project(args.settings, "conf") / "suggest")
    spec, source = twin(args.model, args.settings)
    trials = trials_of(args.session, args.settings, "suggest", marker_places(spec.compile()))
    model = with_room(spec, trials, args.settings)
    ArmModel(model).require_lengths("suggest")
    print(f"twin: {source}", flush=True)
    stages, offered = information_of_stages(model, trials, grid, args.settings, args.only, args.error / 100)
    weights = weights_for(args.goal, stages, model, grid)
    suggestions = suggest(stages, weights, offered, args.count, args.per_minute)
    if not suggestions:
        raise InputError(f"{args.session}: found no trial that would tell more, expected one of {len(offered)}")
    print("\n".join(_report(args, stages, weights, offered, suggestions, trials)))
    return 0


def _check(args: argparse.Namespace) -> None:
    """Refuse options that mean nothing, before any work."""
    if args.goal not in GOALS:
        expected = f"{', '.join(GOALS)}{nearest(args.goal, list(GOALS))}"
        raise InputError(f"--for: found {args.goal!r}, expected one of {expected}")
    kinds = list(EXPERIMENTS)
    for kind in args.only:
        if kind not in kinds:
            raise InputError(f"--only: found {kind!r}, expected some of {', '.join(kinds)}{nearest(kind, kinds)}")
    if not 1 <= args.count <= 100:
        raise InputError(f"--count: found {args.count}, expected 1 to 100 trials")
    if not 0 < args.error <= 100:
        raise InputError(f"--error: found {args.error:g}, expected more than 0 and up to 100 %")


def twin(path: Path | None, root: Path) -> tuple[mujoco.MjSpec, str]:
    """The MJCF at `path`; without, the last that the pipeline in `root` has identified, else the CAD model; and which.
    """
    file = path or final_model(root / "artifacts")
    if file is not None:
        return Twin.load(file).spec, f"{file}"
    description = settings_of("build_mjcf", root)
    return described_arm(description, own_or_project(root, "conf")).spec, DESCRIBED


def with_room(spec: mujoco.MjSpec, trials: list[Trial], root: Path) -> mujoco.MjModel:
    """The arm, with a number for what each session of `trials` has for itself: one that was not identified from them
    has none."""
    for config in _settings(root).values():
        make_room(spec, per_session_names(list(config.parameters), config.per_session, sessions_of(trials)[1:]))
    return spec.compile()


def _settings(root: Path) -> dict[str, IdentificationSettings]:
    """Of the stages in params.yaml."""
    params = read_yaml(root / "params.yaml")
    return {stage: settings_of(stage, root) for stage in STAGES if stage in params}


def information_of_stages(
    model: mujoco.MjModel, trials: list[Trial], grid: Recordable, root: Path, only: list[str], share: float
) -> tuple[Stages, list[Candidate]]:
    """The information that every stage in params.yaml has and would gain, and the candidates on offer: of the kinds
    `only`, if there are any, and none that repeats a trial of the session."""
    settings, stages = _settings(root), []
    read = {kind for config in settings.values() for kind in config.experiments}
    kinds = tuple(kind for kind in EXPERIMENTS if kind in read and (not only or kind in only))
    every = candidates(grid, model, kinds, FRAMES)
    if not every:
        expected = "expected one that a stage identifies from, and this command plans"
        raise InputError(f"--only: found {', '.join(only) or 'no kind'}, {expected}")
    for stage, config in settings.items():
        check_parameters(stage, config, model)
        stages.append(stage_information(stage, config, model, trials, every, grid, share))
    repeated = set().union(*(stage.repeated for stage in stages))
    return stages, [candidate for candidate in every if candidate.name not in repeated]


def _report(
    args: argparse.Namespace, stages: Stages, weights: list, offered: list[Candidate], suggestions: list[Suggestion],
    trials: list[Trial],
) -> list[str]:  # fmt: skip
    goal: Goal = args.goal
    now, count = expected_loss(stages, weights, []), sum(trial.split == IDENTIFY for trial in trials)
    usable = [candidate for candidate in offered if any(candidate.name in stage.added for stage in stages)]
    last, filtered = suggestions[-1], not (args.session / "session.yaml").is_file()
    session = "data/raw/<session>" if filtered else args.session
    minutes = sum(suggestion.candidate.minutes for suggestion in suggestions)
    unit = "minute" if args.per_minute else "trial"
    lines = [
        f"goal: {TITLES[goal]}",
        f"now, with {count} trials to identify from and a fitted model that is off by {args.error:g} %: "
        f"{loss_words(goal, now)}; widest: {widest_words(stages, [])}",
        "", f"suggested, of {len(usable)} that could be recorded, by gain a {unit}, each knowing those before it:",
        *(f"  {line}" for line in table_lines(goal, suggestions)),
        f"after all, {minutes:g} minutes: {loss_words(goal, last.after)}; widest: {widest_words(stages, last.chosen)}",
        "", "why:", *(f"  {n}  {why_words(stages, weights, row)}" for n, row in enumerate(suggestions, 1)),
        "", "how:", *(f"  {n}  {row.candidate.how}" for n, row in enumerate(suggestions, 1)),
        "", "if only one is recorded, the best of each kind:",
        *(f"  {line}" for line in kind_lines(goal, now, after_each(stages, weights, usable, []), usable)),
        "", f"once their logs lie in {session}, add to `trials` in its session.yaml:",
        *entry_lines([suggestion.candidate for suggestion in suggestions], {trial.name for trial in trials}),
        "", "then:", f"  trunkline check {session}", "  dvc repro",
        f"  trunkline suggest {session}",
    ]  # fmt: skip
    return lines


if __name__ == "__main__":
    sys.exit(main())
