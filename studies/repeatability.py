"""Does anything that is known before a release tell where the real arm comes to rest?

    python -m studies.repeatability observations_manual_decay_300g.csv

The tip's place at rest after each release of examples/asl_trunk, and after those of the CSV, by linear regression on
what is known when the arm is let go; each release is told by the others alone. A Markdown table: the mean distance
between told and found, beside that from the others' mean. Run the example's stage `filter` first.
"""

import argparse
import contextlib
import io
import sys
import tempfile
from pathlib import Path

import numpy as np

from examples.asl_trunk.session import HERE, make_loaded_session
from trunkline.errors import in_one_line
from trunkline.recordings.trials.splits import DECIDING
from trunkline.recordings.trials.trial import Trial, read_trials
from trunkline.tools.evaluate.session import trials_of
from upkeep.results import recorded

LAST = 30  # frames in which the arm rests


def told(trials: list[Trial]) -> dict[str, float]:
    """Mean distance, mm, between where the tip rests and where others' releases say, by what they say it from."""
    trials = sorted(trials, key=lambda trial: trial.name)
    rests = np.array([np.nanmean(trial.positions[-LAST:], axis=0) for trial in trials])
    tip = int(np.argmax(np.linalg.norm(rests.mean(axis=0), axis=1)))
    held = np.array([_held(trial) for trial in trials])
    sides = held[:, tip, :2] / np.linalg.norm(held[:, tip, :2], axis=1, keepdims=True)
    turned = np.angle(_plane(held[:, tip]) / _plane(held[:, 0]))
    places, count = rests[:, tip], len(trials)
    before = np.vstack([places[:1], places[:-1]])
    known = {
        "others' mean": np.zeros((count, 0)),
        "side to which it is held": sides,
        "place at which its tip is held": held[:, tip, :2],
        "places of two discs": held[:, [0, tip], :2].reshape(count, -1),
        "how far it is twisted": turned[:, None],
        "its number in the session": np.arange(count)[:, None],
        "where it rested before": before[:, :2],
    }
    return {name: _left_out(values, places) for name, values in known.items()}


def _held(trial: Trial) -> np.ndarray:
    """Where the segments are when the arm is let go, m. Shape (S, 3)."""
    return trial.positions[min(int(np.searchsorted(trial.time, trial.start)), len(trial.time) - 1)]


def _plane(places: np.ndarray) -> np.ndarray:
    """x and y of places (N, 3) as one complex number each."""
    return places[:, 0] + 1j * places[:, 1]


def _left_out(known: np.ndarray, places: np.ndarray) -> float:
    terms, missed = np.column_stack([np.ones(len(places)), known]), []
    for i in range(len(places)):
        others = np.arange(len(places)) != i
        weights = np.linalg.lstsq(terms[others], places[others], rcond=None)[0]
        missed.append(np.linalg.norm(places[i] - terms[i] @ weights))
    return 1e3 * float(np.mean(missed))


def show(source: Path) -> None:
    own = read_trials(HERE / "data" / "processed" / "filter", DECIDING)
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        make_loaded_session(source, 0.1, Path(folder) / "session")
        loaded = trials_of(Path(folder) / "session", HERE, "repeatability")
    columns = [told(own), told(loaded)]
    print(f"| tip at rest told by | {len(own)} releases with 200 g, mm | {len(loaded)} with 300 g, mm |")
    print("|---|---:|---:|")
    for name in columns[0]:
        print(f"| {name} | {' | '.join(f'{column[name]:.3g}' for column in columns)} |")


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path, metavar="CSV", help="releases with 300 g")
    with recorded("repeatability"):
        show(parser.parse_args().source)
    return 0


if __name__ == "__main__":
    sys.exit(main())
