"""How far a model is from a session, without a fit: `trunkline evaluate MODEL SESSION`

Prints the errors of every trial and their means, beside what knows nothing of forces (the mean rest shape, the straight
arm, the start held) and beside the noise floor. All in mm; of what stands beside, position / tip error. Writes
metrics.json, trials.csv, markers.csv and two pictures. With --reference, how the errors changed: has the arm aged?
"""

import argparse
import sys
from pathlib import Path

from threadpoolctl import threadpool_limits

from trunkline.errors import InputError, in_one_line
from trunkline.identification.evaluation.error_tables import marker_table, trial_table
from trunkline.identification.results.scoring import evaluate
from trunkline.identification.simulate.checks import check_trials
from trunkline.model.places import marker_places
from trunkline.pipeline.stage import output_folder, write_metrics
from trunkline.program import add_settings, command_parser
from trunkline.tools.evaluate.model import written_beside
from trunkline.tools.evaluate.report import change_lines, kind_lines, read_reference, trial_lines
from trunkline.tools.evaluate.session import trials_of
from trunkline.twin.twin import Twin


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("evaluate", __doc__)
    parser.add_argument("model", type=Path, metavar="MODEL", help="MJCF of the arm")
    parser.add_argument(
        "session", type=Path, metavar="SESSION",
        help="folder of logs and session.yaml, or of several such, or of filtered trials",
    )  # fmt: skip
    parser.add_argument("--cad", type=Path, metavar="MODEL", help="another MJCF to stand beside, such as the CAD model")
    parser.add_argument("--reference", type=Path, metavar="EVALUATION", help="folder or metrics.json of an earlier one")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where to write; default: evaluation/<session>")
    add_settings(parser)
    args = parser.parse_args(arguments)
    with threadpool_limits(1, user_api="blas"):  # as the stages: sums depend on how many cores there are
        return _run(args)


def _run(args: argparse.Namespace) -> int:
    out = args.out or Path("evaluation") / args.session.resolve().name
    if out.exists() and not (out / "metrics.json").is_file() and any(out.iterdir()):
        raise InputError(f"--out: {out}: found other files in it, expected a new folder or an earlier evaluation")
    reference = None if args.reference is None else read_reference(args.reference)
    if args.reference is not None and out.resolve() in (args.reference.resolve(), args.reference.resolve().parent):
        raise InputError(f"--out: {out}: found the reference there, expected another folder: it would be written over")
    twin = Twin.load(args.model)
    models = {"model": twin.arm.model} | ({} if args.cad is None else {"cad": Twin.load(args.cad).arm.model})
    written = written_beside(twin, args.settings)
    trials = trials_of(args.session, args.settings, "evaluate", marker_places(models["model"]))
    renamed = written.as_fitted(trials)
    if renamed is not trials:
        print(f"evaluate: the session {renamed[0].session} of those that the model was fitted to")
        trials = renamed
    for session in written.namesakes(models["model"], trials):
        doubt = "the model has numbers for a session of that name, and was fitted to no trial of this one"
        print(f"evaluate: warning: session {session}: {doubt}", file=sys.stderr)
    markers = trials[0].markers
    for model in models.values():
        check_trials(trials, model)
    print(f"evaluate: simulating {len(trials)} trials", flush=True)
    metrics, predictions = evaluate(models, trials, written.frames, written.command_delay)
    fitted = {trial.name for trial in trials if written.saw(trial)}
    metrics["evaluated"] = {
        "model": twin.provenance.digest[:16],
        "frames": written.frames,
        "command_delay": written.command_delay,
        "fitted_to": sorted(fitted),
    }
    table = trial_table(predictions)
    print("\nErrors in mm; of what stands beside the model, position / tip error")
    print("\n".join(["", *trial_lines(table, fitted), "", *kind_lines(metrics)]))
    for session, session_metrics in metrics.get("by_session", {}).items():
        print("\n".join(["", f"session {session}", *kind_lines(session_metrics)]))
    if fitted:
        print(f"\n* the model was fitted to these {len(fitted)} of {len(trials)} trials")
    if reference is not None:
        print("\n".join(["", *change_lines(reference, metrics)]))
    _write(out, metrics, table, marker_table(predictions, markers), args.session.resolve().name)
    print(f"\nevaluate: written to {out}")
    return 0


def _write(out: Path, metrics: dict, trials, markers, title: str) -> None:
    from trunkline.report.figures.scoring import marker_figure, trial_figure  # pyplot takes long to import
    from trunkline.report.figures.style import save_figure

    with output_folder(out) as folder:
        write_metrics(folder, metrics)
        trials.to_csv(folder / "trials.csv", index=False, float_format="%.6g")
        markers.to_csv(folder / "markers.csv", index=False, float_format="%.6g")
        save_figure(trial_figure({title: trials}), folder / "errors.png")
        save_figure(marker_figure({title: markers}), folder / "markers.png")


if __name__ == "__main__":
    sys.exit(main())
