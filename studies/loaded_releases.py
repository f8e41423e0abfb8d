"""The real arm with another load: `python -m studies.loaded_releases CSV [LOAD]`

What the model of examples/asl_trunk, identified from releases with 200 g at the tip, says of those of CSV, with LOAD kg
more (0.1) and nothing else changed; beside that the same without the load, null models and the noise floor. A Markdown
table. Run the example's stages first.
"""

import argparse
import contextlib
import io
import sys
import tempfile
from pathlib import Path

from examples.asl_trunk.session import HERE, make_loaded_session
from trunkline.errors import in_one_line
from trunkline.identification.evaluation.error_tables import LABELS
from trunkline.identification.results.scoring import evaluate
from trunkline.tools.evaluate.model import read_arm, written_beside
from trunkline.tools.evaluate.session import trials_of
from upkeep.results import recorded

MODEL = HERE / "artifacts" / "identify_damping" / "arm.xml"
BESIDE = ("null", "null_straight", "noise_floor")


def measured(source: Path, load: float) -> dict:
    """Metrics of all releases of the CSV `source`, as `trunkline.tools.evaluate` gives them."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        session = Path(folder) / "session"
        make_loaded_session(source, load, session)
        trials = trials_of(session, HERE, "loaded_releases")
    written = written_beside(MODEL, HERE)
    return evaluate({"model": read_arm(MODEL)}, trials, written.frames, written.command_delay)[0]


def row(name: str, found: dict) -> str:
    """Position / tip error: whole, and with each trial's own rest offset taken out, where it is told."""
    cells = []
    for of in ("", "_about_rest"):
        keys = [f"e_{what}{of}_{unit}" for unit in ("mm", "pct") for what in ("position", "tip")]
        told = [f"{found[key]:.3g}" if key in found else "" for key in keys]
        cells.append(f"{told[0]} / {told[1]} ({told[2]} / {told[3]} %)" if all(told) else "–")
    late = f"{found['e_late_speed_pct']:.0f} %" if "e_late_speed_pct" in found else "–"
    return f"| {name} | {' | '.join(cells)} | {late} |"


def show(source: Path, load: float) -> None:
    loaded, without = measured(source, load), measured(source, 0.0)
    what = f"{loaded['model']['trials']} releases: position / tip error, mm"
    print(f"| {what} | whole | about each one's rest | late speed |")
    print("|---|---:|---:|---:|")
    print(row(f"identified, {1e3 * load:g} g more", loaded["model"]))
    print(row("identified, load not changed", without["model"]))
    for name in BESIDE:
        print(row(LABELS[name], loaded[name]))
    scatter = loaded["repeatability_mm"]["release"]
    print(f"| repeatability | {scatter['mean_mm']:.3g} / {scatter['tip_mm']:.3g} | – | – |")


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path, metavar="CSV")
    parser.add_argument("load", type=float, nargs="?", default=0.1, metavar="LOAD", help="kg")
    given = parser.parse_args()
    with recorded("loaded_releases"):
        show(given.source, given.load)
    return 0


if __name__ == "__main__":
    sys.exit(main())
