"""A new twin in an old one's place, if it replays the sessions of both: `trunkline promote OLD NEW SESSION SESSION`

OLD and NEW are folders of artifacts, or Unity packages. Both simulate the trials to validate of both sessions that
neither was fitted to. NEW takes the place of OLD where it is better on its session and on neither much worse, kind by
kind; the old one then stays beside as OLD.before. Otherwise, and after any mistake, OLD stays where it is, and the exit
code is 1. Every decision is kept in OLD.promotion.json, with its reasons.
"""

import argparse
import json
import os
import shutil
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from threadpoolctl import threadpool_limits

from trunkline.errors import InputError, in_one_line
from trunkline.files import written_whole
from trunkline.identification.results.scoring import evaluate
from trunkline.identification.simulate.checks import check_trials
from trunkline.model.places import marker_places
from trunkline.pipeline.stage import write_json
from trunkline.program import add_settings, command_parser, program_name
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.tools.evaluate.model import written_beside
from trunkline.tools.evaluate.session import trials_of
from trunkline.tools.promote.gate import REPLAYED, against
from trunkline.twin.twin import Twin

BEFORE, DECISIONS = ".before", ".promotion.json"  # end the names of what is written beside the twin


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("promote", __doc__)
    parser.add_argument("old", type=Path, metavar="OLD", help="the twin in use")
    parser.add_argument("new", type=Path, metavar="NEW", help="what is to take its place; it is copied")
    parser.add_argument("sessions", type=Path, nargs=2, metavar="SESSION", help="OLD's, then NEW's")
    add_settings(parser)
    args = parser.parse_args(arguments)
    paths = (args.old, args.new)
    kinds = ["a folder" if path.is_dir() else path.suffix if path.is_file() else "nothing" for path in paths]
    if kinds not in (["a folder"] * 2, [".tgz"] * 2) or args.old.is_symlink():
        actual = "a link" if args.old.is_symlink() else " and ".join(kinds)
        raise InputError(f"{args.old}, {args.new}: found {actual}, expected two folders of artifacts, or two .tgz")
    decisions_file = args.old.with_name(args.old.name + DECISIONS)
    decisions = _read(decisions_file)
    decision: dict = {"time": datetime.now(UTC).isoformat(timespec="seconds"), "promoted": False}
    try:
        with threadpool_limits(1, user_api="blas"):  # as the stages: sums depend on how many cores there are
            reasons = _judged(args, decision)
    except InputError as error:
        reasons = [str(error)]
    decision |= {"promoted": not reasons, "reasons": reasons}
    if reasons:
        _keep(decisions_file, [*decisions, decision])
    else:
        keep = partial(_keep, decisions_file, [*decisions, decision])
        _exchange(args.old, args.new, decision["new_model"], keep)
    print("\n".join(f"promote: {reason}" for reason in reasons))
    print(f"promote: {args.old}: " + ("the old twin stays" if reasons else f"now {args.new}, which passed on both"))
    return 1 if reasons else 0


def _judged(args: argparse.Namespace, decision: dict) -> list[str]:
    """The reasons against the new twin; what it is judged by goes into `decision`."""
    twins = {name: Twin.load(path) for name, path in (("old", args.old), ("new", args.new))}
    written = {name: written_beside(twin, args.settings) for name, twin in twins.items()}
    frames = max(each.frames for each in written.values())
    decision |= {f"{name}_model": twin.provenance.digest for name, twin in twins.items()} | {"errors": []}
    reasons = []
    for owner, session in zip(twins, args.sessions, strict=True):
        trials = trials_of(session, args.settings, "promote", marker_places(twins[owner].arm.model))
        named = {name: each.as_fitted(trials) for name, each in written.items()}
        fitted = [any(written[name].saw(named[name][i]) for name in named) for i in range(len(trials))]
        fresh = [i for i, trial in enumerate(trials) if trial.split == VALIDATE and not fitted[i]]
        if not fresh:
            raise InputError(f"{session}: found no trial to {VALIDATE} that neither twin was fitted to, expected some")
        print(f"promote: {session}: simulating {len(fresh)} trials with both twins", flush=True)
        errors = {}
        for name, twin in twins.items():
            chosen, model = [named[name][i] for i in fresh], twin.arm.model
            check_trials(chosen, model)
            errors[name] = evaluate({"model": model}, chosen, frames, written[name].command_delay)[0]
        table = {name: {kind: {error: row.get(error) for error in REPLAYED}
                        for kind, row in metrics["model"]["by_experiment"].items()}
                 for name, metrics in errors.items()}  # fmt: skip
        decision["errors"].append({"session": f"{session}", "trials": len(fresh)} | table)
        reasons += against(f"{session}", errors["old"], errors["new"], better=owner == "new")
    return reasons


def _exchange(old: Path, new: Path, digest: str, then: Callable[[], None]) -> None:
    """Put a copy of `new` in the place of `old`, which stays beside; `then` is the last step. Where anything fails, the
    old one is where it was. digest: of the model that was judged."""
    part, before = old.with_name(f".part.{old.name}"), old.with_name(old.name + BEFORE)
    _remove(part)
    shutil.copytree(new, part) if new.is_dir() else shutil.copy2(new, part)
    if Twin.load(part).provenance.digest != digest:
        raise InputError(f"{new}: found another model than the one that was judged, expected the same")
    _remove(before)
    os.rename(old, before)
    try:
        os.rename(part, old)
        then()
    except BaseException:
        if old.exists():
            os.rename(old, part)
        os.rename(before, old)
        raise


def _remove(path: Path) -> None:
    """A folder or a file, where there is one."""
    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _read(file: Path) -> list[dict]:
    """Earlier decisions, none where there is no such file."""
    try:
        return [*(json.loads(file.read_text(encoding="utf-8")) if file.exists() else [])]
    except (ValueError, TypeError) as error:
        raise InputError(f"{file}: {error}, expected what `{program_name('promote')}` writes") from error


def _keep(file: Path, decisions: list[dict]) -> None:
    with written_whole(file) as part:
        write_json(part, decisions)


if __name__ == "__main__":
    sys.exit(main())
