"""The session of the ASL Trunk's commanded motion: `python -m examples.asl_motion.session SOURCE`

SOURCE is a folder with `control_inputs_controlled_1.csv`, `observations_controlled_1.csv` and
`observations_controlled_1_200g.csv`, from stack/main/data/trajectories/dynamic/servo_motor_archive of the public
repository StanfordASL/trunk-stack. Each recording becomes a log, of which every 25 s are a trial. They go to
data/raw/asl_motion beside this file, with a session.yaml.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from examples.asl_trunk.session import BODIES, EPOCH, RATE, read_table, write_log, write_session
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.stage import output_folder
from trunkline.recordings.trials.splits import IDENTIFY, TEST, VALIDATE

HERE = Path(__file__).parent
SESSION = HERE / "data" / "raw" / "asl_motion"
MOTORS = tuple(f"u{number}" for number in range(1, 7))
COMMANDS = ("ID", *MOTORS)
OBSERVED = ("ID", *(f"{axis}{body}" for body in BODIES for axis in "xyz"), *(f"phi{n}" for n in range(1, 7)))
LOADS = {"unloaded": ("observations_controlled_1.csv", 0.0), "loaded": ("observations_controlled_1_200g.csv", 0.2)}
PIECE = 25.0  # s of a trial
SPLITS = {  # of the pieces of each log; one with a load tells what the arm weighs
    "unloaded": (IDENTIFY, IDENTIFY, IDENTIFY, IDENTIFY, VALIDATE, TEST),
    "loaded": (IDENTIFY, TEST, TEST, TEST, TEST, TEST),
}


def trials_of(name: str, load: float) -> list[dict]:
    """An entry of session.yaml for each piece of a log."""
    entries = []
    for number, split in enumerate(SPLITS[name]):
        window = [PIECE * number, PIECE * (number + 1) - 1 / RATE]
        entry = {"name": f"{name}_{number}", "file": f"{name}.mcap", "window": window, "experiment": "motion"}
        entries.append(entry | {"load": load, "split": split})
    return entries


def make_session(source: Path, session: Path = SESSION) -> int:
    """Fill the folder `session` from `source`; the number of trials. Raises InputError where a file is not right."""
    path = source / "control_inputs_controlled_1.csv"
    commands = np.array(read_table(path, COMMANDS))[:, 1:]
    with output_folder(session) as folder:
        entries = []
        for name, (file, load) in LOADS.items():
            observed = np.array(read_table(source / file, OBSERVED))[:, 1:]
            if len(observed) < len(commands):
                raise InputError(f"{source / file}: found {len(observed)} rows, expected the {len(commands)} of {path}")
            positions = observed[: len(commands), : 3 * len(BODIES)].reshape(-1, len(BODIES), 3)
            sent = dict(zip(MOTORS, commands.T, strict=True))
            write_log(folder / f"{name}.mcap", positions, EPOCH * 1_000_000_000, sent)
            entries += trials_of(name, load)
        write_session(folder, (HERE / "session.yaml").read_text(encoding="utf-8"), entries)
    return len(entries)


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m examples.asl_motion.session",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("source", type=Path, metavar="SOURCE", help="folder with the three CSV files")
    count = make_session(parser.parse_args(arguments).source)
    print(f"{SESSION}: {len(LOADS)} logs, {count} trials and session.yaml")
    return 0


if __name__ == "__main__":
    sys.exit(main())
