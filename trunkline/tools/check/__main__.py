"""What a session can identify, in seconds: `trunkline check SESSION`

Loads the logs as the stages do, lists what was recorded and what is missing, and predicts how well each parameter in
params.yaml can be identified if the fitted model is off by half a percent of each point's distance from the base. Fits
and writes nothing.
"""

import sys
from pathlib import Path

from trunkline.errors import in_one_line
from trunkline.identification.diagnostics.identifiability import (
    described_lines,
    expected_identifiability,
    to_identify_from,
    unidentifiable,
)
from trunkline.identification.fit.setup import check_parameters, unidentifiable_mass
from trunkline.identification.parameters.per_session import add_sessions
from trunkline.identification.simulate.checks import check_trials
from trunkline.identification.stages import STAGES
from trunkline.model.arm.kinds import described_arm
from trunkline.model.places import marker_places
from trunkline.pipeline.config import own_or_project, settings_of
from trunkline.program import add_settings, command_parser
from trunkline.recordings.trials.inventory import missing_lines, recorded_of_each
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY
from trunkline.settings import read_yaml
from trunkline.tools.check.sides import side_lines
from trunkline.tools.check.up_axis import other_ups, up_lines
from trunkline.tools.describe.words import slips
from trunkline.tools.evaluate.session import read_trials_of


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("check", __doc__)
    parser.add_argument("session", type=Path, metavar="SESSION",
                        help="folder of logs and session.yaml, or of several such, or of filtered trials")  # fmt: skip
    parser.add_argument("--error", type=float, default=0.5, metavar="PERCENT",
                        help="by which the fitted model will be off, of a point's distance from the base")  # fmt: skip
    add_settings(parser, "describes arm and stages")
    args = parser.parse_args(arguments)
    description = settings_of("build_mjcf", args.settings)
    spec = described_arm(description, own_or_project(args.settings, "conf")).spec
    model = spec.compile()
    params = read_yaml(args.settings / "params.yaml")
    configs = {stage: settings_of(stage, args.settings) for stage in STAGES if stage in params}
    if arm := (params.get("build_mjcf") or {}).get("arm"):
        print(f"arm: {arm}, as {args.settings / 'params.yaml'} has it", flush=True)
    for line in slips(model):
        print(f"note: {line}", flush=True)
    trials, raw_trials = read_trials_of(args.session, args.settings, "check", marker_places(model))
    check_trials([trial for trial in trials if trial.split in DECIDING], model)
    print("\n".join(["recorded:", *(f"  {line}" for line in recorded_of_each(trials))]))
    if missing := missing_lines(trials):
        print("\n".join(["missing:", *(f"  {line}" for line in missing)]))
    if lines := side_lines([trial for trial in trials if trial.split in DECIDING], model):
        print("\n".join(lines))
    ups = other_ups(raw_trials)
    for stage, config in configs.items():
        check_parameters(stage, config, model)
        lines = add_sessions(spec, list(config.parameters), config.per_session, config.experiments, trials)
        model = spec.compile()
        lacking = unidentifiable(config, trials) or [*lines, *unidentifiable_mass(config, trials)]
        chosen = [t for t in trials if t.experiment in config.experiments and t.split == IDENTIFY]
        print(f"{stage}, from {len(chosen)} trials:", flush=True)
        for line in lacking:
            print(f"  {line}")
        if lacking:
            continue
        arm, experiments, fit = to_identify_from(config, model, trials)
        lines = described_lines(arm, experiments, fit) + up_lines(arm, experiments, fit.markers, ups)
        print("\n".join(f"  {line}" for line in lines), flush=True)
        parameters, pairs = expected_identifiability(arm, experiments, fit, args.error / 100)
        for parameter in sorted(parameters, key=lambda parameter: -parameter.share):
            print(f"  {parameter.words()}")
        for pair in pairs:
            print(f"  hardly told apart: {pair}")
    print("All of it is of the arm as described: where a fit ends elsewhere, some of it changes several-fold.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
