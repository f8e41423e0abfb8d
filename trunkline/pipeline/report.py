"""The certificate, brought up to date: `trunkline report`

It is the stage `report`, by DVC: stages before it run where code, settings or logs changed since, which may take hours;
`--dry-run` says what changed. The page is artifacts/report/certificate.html, the same facts as JSON lie beside it.
"""

import os
import subprocess
import sys
from pathlib import Path

from trunkline.errors import in_one_line
from trunkline.pipeline.checkout import require_checkout
from trunkline.program import command_parser

PAGE = Path("artifacts/report/certificate.html")


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("report", __doc__)
    parser.add_argument("--dry-run", action="store_true", help="say what changed since they ran, and run none")
    parser.add_argument("--project", type=Path, metavar="FOLDER", default=Path("."),
                        help="where dvc.yaml is; default: the current folder")  # fmt: skip
    args = parser.parse_args(arguments)
    require_checkout(args.project)
    # a stage is `python -m ...`: of this Python, also where its environment is not the activated one
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    # `dvc repro --dry` ends at the first stage whose inputs another one has yet to write, as in a fresh clone
    verb = ["status", "--with-deps"] if args.dry_run else ["repro"]
    env = os.environ | {"PATH": path}
    settings = [sys.executable, "-m", "trunkline.pipeline.settings"]  # DVC says of a mistake there less, and later
    has_settings = (args.project / "params.yaml").is_file()
    if has_settings and (code := subprocess.run(settings, cwd=args.project, env=env).returncode):
        return code
    code = subprocess.run([sys.executable, "-m", "dvc", *verb, "report"], cwd=args.project, env=env).returncode
    if code == 0 and not args.dry_run:
        print(f"report: {args.project / PAGE}")
    return code


if __name__ == "__main__":
    sys.exit(main())
