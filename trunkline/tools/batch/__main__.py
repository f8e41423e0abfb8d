"""The pipeline for many arms or sessions, and one table over all of them: `trunkline batch LIST.yaml`

Runs the stages up to `score` for each arm of the list, each in a folder of its own under --out; what has run is not run
again, and an arm that fails does not stop the others. Then prints errors and parameters of all, with intervals and
drift, and writes fleet.csv, fleet.md and fleet.png. Ends with 1 where an arm failed.
"""

import sys
import time
from pathlib import Path

from trunkline.errors import InputError, in_one_line
from trunkline.program import command_parser
from trunkline.tools.batch.listing import Listing, read_listing
from trunkline.tools.batch.results import Results, drift, read_results
from trunkline.tools.batch.running import prepare, run
from trunkline.tools.batch.words import error_table, long_table, parameter_table


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("batch", __doc__)
    parser.add_argument("list", type=Path, metavar="LIST.yaml", help="the arms: docs/lab-tools.md")
    parser.add_argument("--out", type=Path, metavar="FOLDER", default=Path("build/fleet"), help="default: build/fleet")
    parser.add_argument("--until", metavar="STAGE", default="score", help="the last stage to run; default: score")
    parser.add_argument("--only-table", action="store_true", help="run nothing, print the results there are")
    args = parser.parse_args(arguments)
    listing = read_listing(args.list)
    failed = {} if args.only_table else run_all(listing, args.out, args.until)
    fleet = [
        read_results(arm.name, Path(arm.folder) if arm.folder else args.out / arm.name) for arm in listing.arms
    ]
    identified = [results for results in fleet if results.posterior.names or results.errors]
    if args.only_table and not identified:
        raise InputError(f"{args.list}: found no results of any arm, expected those of at least one")
    if identified:
        _tell(listing, identified, args.out)
    for name in [results.name for results in fleet if results not in identified and results.name not in failed]:
        print(f"batch: {name}: nothing is identified yet", file=sys.stderr)
    _say_failed(failed)
    return 1 if failed else 0


def run_all(listing: Listing, out: Path, until: str) -> dict[str, str]:
    """Run every arm's pipeline, a line each; why it failed, for those that did."""
    failed = {}
    for arm in listing.arms:
        if arm.folder:
            continue
        begun = time.monotonic()
        print(f"batch: {arm.name}: up to {until}", flush=True)
        try:
            prepare(arm, out / arm.name, until)
            reason = run(out / arm.name)
        except InputError as error:
            reason = str(error)
        if reason is not None:
            failed[arm.name] = reason
        print(f"batch: {arm.name}: {'failed' if reason else 'done'} after {time.monotonic() - begun:.0f} s", flush=True)
    return failed


def _tell(listing: Listing, fleet: list[Results], out: Path) -> None:
    from trunkline.report.figures.batch import batch_figure  # pyplot takes long to import
    from trunkline.report.figures.style import save_figure

    by_name = {results.name: results for results in fleet}
    earlier = {arm.name: listing.earlier(arm) for arm in listing.arms if arm.name in by_name}
    since = {name: reference for name, reference in earlier.items() if reference is not None and reference in by_name}
    drifts = {name: drift(by_name[name], by_name[reference]) for name, reference in since.items()}
    words = ["95 % intervals, given the model"]
    if since:
        words.append(f"then the drift since {', '.join(sorted(set(since.values())))}, bold where beyond both intervals")
    below = f"In brackets: {'; '.join(words)}."
    text = "\n".join([*error_table(fleet), "", *parameter_table(fleet, drifts), "", below])
    table = long_table(fleet, drifts, since)
    print(f"\n{text}\n")
    out.mkdir(parents=True, exist_ok=True)
    (out / ".fleet.md").write_text(text + "\n", encoding="utf-8")
    table.to_csv(out / ".fleet.csv", index=False, float_format="%.6g")
    save_figure(batch_figure(table), out / ".fleet.png")
    for name in ("fleet.md", "fleet.csv", "fleet.png"):
        (out / f".{name}").replace(out / name)
    print(f"batch: written to {out}")


def _say_failed(failed: dict[str, str]) -> None:
    for name, reason in failed.items():
        print(f"batch: {name}: failed: {reason}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
