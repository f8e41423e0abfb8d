"""Whether an arm has changed since its model was identified: `trunkline monitor MODEL FOLDER`

Into FOLDER a lab drops sessions (folders with logs and session.yaml), or logs of one. Each trial is scored against the
model without a fit; a control chart says when the arm has changed and which parameter would explain it. Writes
scores.jsonl, chart.csv and chart.png. Ends with 0 where no change is seen, 1 where it has changed, 2 where an input
cannot be used; without --once it looks again and again, until it is interrupted.
"""

import argparse
import sys
import time
from pathlib import Path

from threadpoolctl import threadpool_limits

from trunkline.errors import in_one_line
from trunkline.program import add_settings, command_parser
from trunkline.tools.monitor.monitor import LEARN, DriftMonitor

UNCHANGED, CHANGED, UNUSABLE = 0, 1, 2
ENDED = 10  # apart from what `in_one_line` returns after a mistake


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("monitor", __doc__)
    parser.add_argument("model", type=Path, metavar="MODEL", help="MJCF of the arm")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="into which sessions are dropped, or a session")
    parser.add_argument("--reference", type=Path, metavar="SESSION",
                        help="trials of the unchanged arm: a folder of logs and session.yaml, or of filtered trials; "
                        f"without it, the first {LEARN} of each kind that come")  # fmt: skip
    parser.add_argument("--once", action="store_true", help="look once and end")
    parser.add_argument("--every", type=float, default=10.0, metavar="SECONDS", help="between two looks; default: 10")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where to write; default: watch/<folder>")
    add_settings(parser)
    args = parser.parse_args(arguments)
    ended = _run(args)
    return ended - ENDED if ended >= ENDED else UNUSABLE


@in_one_line
def _run(args: argparse.Namespace) -> int:
    out = args.out or Path("watch") / args.folder.resolve().name
    with threadpool_limits(1, user_api="blas"), DriftMonitor.begun(args.model, args.folder, args.reference, out,
                                                            args.settings) as monitor:  # fmt: skip
        try:
            while True:
                unusable = monitor.look()
                if args.once:
                    print(f"monitor: {monitor.summary()}")
                    break
                time.sleep(args.every)
        except KeyboardInterrupt:
            unusable = 0
            print("monitor: interrupted; what was scored is kept")
        changed = monitor.chart.changed() is not None
        return ENDED + (CHANGED if changed else UNUSABLE if unusable else UNCHANGED)


if __name__ == "__main__":
    sys.exit(main())
