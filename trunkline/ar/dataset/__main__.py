"""What operators did, as a dataset for LeRobot: `python -m trunkline.ar.dataset LOG... --out FOLDER`

LOG is the log of a live session. An episode goes from when the robot was let move until it was done: a plan that was
executed, or a stretch of following. Each frame has the joints and pulls as measured and the tip, what was aimed at, the
operator's rays, and as its action what was sent. LeRobotDataset("any/name", root="FOLDER") opens it.
"""

import argparse
import sys
from pathlib import Path

from trunkline.ar.dataset.dataset import write_dataset
from trunkline.ar.dataset.episodes import Episode, episodes
from trunkline.ar.dataset.recording import read_recording
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.stage import output_folder
from trunkline.program import program_name

ROBOT = "panda_with_soft_arm"


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog=program_name("trunkline.ar.dataset"), description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="of the dataset; it must not exist")
    parser.add_argument("--fps", type=int, default=30, help="frames a second")
    parser.add_argument("--task", default="", metavar="WORDS", help="instead of what the targets say")
    parser.add_argument("--all", action="store_true", help="with what was stopped, failed or did not hold its thing")
    parser.add_argument(
        "--aiming", action="store_true", help="with how the user came to it; the robot stands meanwhile"
    )
    told = parser.parse_args(arguments)
    if told.fps < 1:
        raise InputError(f"--fps: found {told.fps}, expected 1 or more")
    if told.out.exists() and (not told.out.is_dir() or any(told.out.iterdir())):
        raise InputError(f"--out: {told.out}: found something there, expected a new folder")
    kept: list[Episode] = []
    for path in told.logs:
        found = [*episodes(read_recording(path), told.fps, told.aiming)]
        own = [episode for episode in found if episode.succeeded or told.all]
        for episode in own:
            _require_same(path, episode, (kept or own)[0])
        kept += own
        ended = "".join(f"; {one.end}: {one.task}" for one in found if not one.succeeded)
        print(f"{path}: {len(found)} demonstrations, {len(own)} taken{ended}")
    if not kept:
        raise InputError("LOG: found no demonstration to take, expected a plan that was executed (--all: or tried)")
    if told.task:
        kept = [Episode(told.task, one.succeeded, one.end, one.frames, one.names) for one in kept]
    with output_folder(told.out) as folder:
        write_dataset(folder, kept, told.fps, ROBOT)
    count = sum(len(one.frames["action"]) for one in kept)
    print(f"demonstrations: {len(kept)} episodes, {count} frames at {told.fps} a second, written to {told.out}")
    return 0


def _require_same(path: Path, episode: Episode, first: Episode) -> None:
    for feature, names in episode.names.items():
        if names != first.names[feature]:
            odd = sorted(set(names) ^ set(first.names[feature])) or ["their order"]
            raise InputError(f"{path}: {feature}: found other axes than in the first log: {', '.join(odd)}")


if __name__ == "__main__":
    sys.exit(main())
