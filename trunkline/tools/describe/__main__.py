"""An arm as described: `trunkline describe ARM`

ARM is a description, a YAML of `conf/build_mjcf/arm/`, or a model in MJCF. Prints its units, its tendons with their
moment arms, its tracked points, and what no log can identify; with --session, what that session's logs cannot. Draws
the arm.
"""

import sys
from pathlib import Path

from trunkline.errors import in_one_line
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.supported import require_supported
from trunkline.program import command_parser
from trunkline.recordings.session.session import read_session
from trunkline.report.figures.arm import arm_figure
from trunkline.report.figures.style import save_figure
from trunkline.tools.describe.drawing import read_drawing
from trunkline.tools.describe.words import doubt_lines, marker_lines, tendon_lines, unit_lines

DRAWINGS = Path("artifacts/describe")  # below the current folder; Git ignores pictures there


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("describe", __doc__)
    parser.add_argument("arm", type=Path, metavar="ARM", help="an arm's YAML, or a model in MJCF")
    parser.add_argument("--session", type=Path, metavar="FOLDER", help="of logs and session.yaml")
    parser.add_argument("--out", type=Path, metavar="PNG",
                        help=f"the drawing; default: {DRAWINGS}/<ARM's name>.png")  # fmt: skip
    args = parser.parse_args(arguments)
    model = read_drawing(args.arm, Path("."))
    if model.nu or len(ArmModel(model).cables):
        read_chain(model)  # what the statics cannot solve is told here
    else:
        require_supported(model)
    session = None if args.session is None else read_session(args.session)
    for lines in (unit_lines(model), tendon_lines(model), marker_lines(model)):
        print("\n".join(lines))
    print("\n".join(f"note: {line}" for line in doubt_lines(model, session)))
    out = args.out or DRAWINGS / f"{args.arm.stem}.png"
    if args.out is None:
        DRAWINGS.mkdir(parents=True, exist_ok=True)
    save_figure(arm_figure(model), out)
    print(f"drawn in {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
