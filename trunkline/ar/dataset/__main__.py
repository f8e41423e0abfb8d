"""What operators did, as a dataset for LeRobot: `trunkline export-dataset LOG... --out FOLDER`

LOG is the log of a live session. An episode goes from when the robot was let move until it was done: a plan that was
executed, or a stretch of following. Each frame has the joints and pulls as measured and the tip, what was aimed at, the
operator's rays, and as its action what was sent. LeRobotDataset("any/name", root="FOLDER") opens it.
"""

import sys
from pathlib import Path

from trunkline.ar.dataset.dataset import write_dataset
from trunkline.ar.dataset.episodes import Episode, episodes
from trunkline.ar.dataset.recording import read_recording
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.stage import output_folder
from trunkline.program import command_parser

ROBOT = "panda_with_soft_arm"


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("export-dataset", __doc__)
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="of the dataset; it must not exist")
    parser.add_argument("--fps", type=int, default=30, help="frames a second")
    parser.add_argument("--task", default="", metavar="WORDS", help="instead of what the targets say")
    parser.add_argument("--all", action="store_true", help="with what was stopped, failed or did not hold its object")
    parser.add_argument(
        "--aiming", action="store_true", help="with how the user came to it; the robot stands meanwhile"
    )
    args = parser.parse_args(arguments)
    if args.fps < 1:
        raise InputError(f"--fps: found {args.fps}, expected 1 or more")
    if args.out.exists() and (not args.out.is_dir() or any(args.out.iterdir())):
        raise InputError(f"--out: {args.out}: found something there, expected a new folder")
    selected: list[Episode] = []
    for path in args.logs:
        recorded = [*episodes(read_recording(path), args.fps, args.aiming)]
        accepted = [episode for episode in recorded if episode.succeeded or args.all]
        for episode in accepted:
            _require_same(path, episode, (selected or accepted)[0])
        selected += accepted
        ended = "".join(f"; {episode.end}: {episode.task}" for episode in recorded if not episode.succeeded)
        print(f"{path}: {len(recorded)} demonstrations, {len(accepted)} taken{ended}")
    if not selected:
        raise InputError("LOG: found no demonstration to take, expected a plan that was executed (--all: or tried)")
    if args.task:
        selected = [
            Episode(args.task, episode.succeeded, episode.end, episode.frames, episode.names) for episode in selected
        ]
    with output_folder(args.out) as folder:
        write_dataset(folder, selected, args.fps, ROBOT)
    count = sum(len(episode.frames["action"]) for episode in selected)
    print(f"demonstrations: {len(selected)} episodes, {count} frames at {args.fps} a second, written to {args.out}")
    return 0


def _require_same(path: Path, episode: Episode, first: Episode) -> None:
    for feature, names in episode.names.items():
        if names != first.names[feature]:
            odd = sorted(set(names) ^ set(first.names[feature])) or ["their order"]
            raise InputError(f"{path}: {feature}: found other axes than in the first log: {', '.join(odd)}")


if __name__ == "__main__":
    sys.exit(main())
