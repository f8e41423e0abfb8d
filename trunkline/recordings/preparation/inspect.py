"""What logs hold, and a session.yaml for them: `trunkline inspect LOG…`

Prints of each log its topics with their rates, its bodies with how often they are seen, and the gaps; then a
session.yaml in which you have to check each trial's experiment, level and split. Writes nothing.
"""

import sys
from pathlib import Path

from trunkline.errors import InputError, in_one_line
from trunkline.program import command_parser
from trunkline.recordings.logs.bag2 import bag_folder
from trunkline.recordings.preparation.proposal import propose
from trunkline.recordings.preparation.survey import LogSurvey, describe, survey
from trunkline.recordings.preparation.table_survey import survey_table
from trunkline.recordings.session.layout import TABLES
from trunkline.recordings.session.session import TABLE_REMEDY, logs_in, some_of, tables_in, unread_in, unreadable_in


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("inspect", __doc__)
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG",
                        help="an MCAP log, a bag, or a folder of them, or of folders with one each")  # fmt: skip
    surveys, code, places = [], 0, parser.parse_args(arguments).logs
    for path in _logs(places):
        try:
            new = survey_table(path) if path.suffix.lower() in TABLES else [survey(path)]
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            code = 1
            continue
        surveys += new
        print("\n".join(describe(new[0])))
    for line in _left_out(surveys, places):
        print(line)
    folder = places[0] if len(places) == 1 and places[0].is_dir() and bag_folder(places[0]) is None else None
    if text := propose(surveys, folder=folder):
        print(f"\nProposed session.yaml:\n\n{text}")
        return code
    if surveys:
        print("\nNo log holds poses: no session.yaml to propose.", file=sys.stderr)
    return 1


def _left_out(surveys: list[LogSurvey], places: list[Path]) -> list[str]:
    """What is in no proposal, and why, a line each."""
    empty = [str(survey.log.path) for survey in surveys if survey.poses is None or not len(survey.poses.stamps)]
    lines = [f"left out: {some_of(empty)}: no poses that can be read"] if empty else []
    for place in places:
        if place.is_dir() and bag_folder(place) is None:
            unread = unread_in(place)
            if not logs_in(place):
                unread.pop(TABLE_REMEDY, None)  # these are what was looked at
            lines += [f"left out: {some_of(files)} in {place}: {remedy}" for remedy, files in unread.items()]
    return lines


def _logs(paths: list[Path]) -> list[Path]:
    """The logs that are named, and those in folders that are, or one folder further down.

    Raises:
        InputError: a folder holds none.
    """
    logs = []
    for path in paths:
        whole = not path.is_dir() or bag_folder(path) is not None
        names = [] if whole else logs_in(path) or tables_in(path)
        inside = [path if path.name else path.resolve()] if whole else [path / name for name in names]
        if not inside:
            raise InputError(f"{path}: found no log, nor one folder down, expected some{unreadable_in(path)}")
        logs += inside
    return list(dict.fromkeys(logs))


if __name__ == "__main__":
    sys.exit(main())
