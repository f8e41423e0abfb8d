"""What logs hold, and a session.yaml for them: `trunkline inspect LOG…`

Prints of each log its topics with their rates, its bodies with how often they are seen, and the gaps; then a
session.yaml in which you have to check each trial's experiment, level and split. Writes nothing.
"""

import argparse
import sys
from pathlib import Path

from trunkline.errors import InputError, in_one_line
from trunkline.program import program_name
from trunkline.recordings.preparation.proposal import propose
from trunkline.recordings.preparation.survey import describe, survey


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog=program_name("inspect"), description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="an MCAP log, or a folder of them")
    surveys, code = [], 0
    for path in _logs(parser.parse_args(arguments).logs):
        try:
            surveys.append(survey(path))
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            code = 1
            continue
        print("\n".join(describe(surveys[-1])))
    text = propose(surveys)
    print(f"\nProposed session.yaml:\n\n{text}" if text else "\nNo log holds poses: no session.yaml to propose.")
    return code


def _logs(paths: list[Path]) -> list[Path]:
    return [log for path in paths for log in (sorted(path.glob("*.mcap")) if path.is_dir() else [path])]


if __name__ == "__main__":
    sys.exit(main())
