"""The heaviest mass that the arm holds: `python -m studies.payload`

Goes over the cells of `payload.yaml` beside it and adds a row for each to docs/results/payload.csv as soon as it is
done; stopped, it goes on from there. Rows of other code, other settings or another arm stay, and count for nothing.
`--quick` is a small chart that is not kept: hanging objects of two diameters, 1 placement, a coarser ladder.
`--cells N` stops after N more. Prints the rows and their cost; docs/results/payload.png shows them.
"""

import argparse
import contextlib
import sys
import time
from dataclasses import asdict, astuple, fields
from pathlib import Path

import pandas as pd
from omegaconf import OmegaConf

from studies.payload.chart import Cell, HeaviestMass, PayloadSettings, cells, heaviest
from studies.payload.figure import payload_figure
from studies.rows import Rows, digest
from trunkline.ar.hybrid.friction import IMPRATIO, SOLIMP, SOLREF
from trunkline.compute.progress import progress
from trunkline.errors import in_one_line
from trunkline.model_files import read_spec
from trunkline.pipeline.config import validated
from trunkline.report.figures.style import save_figure
from trunkline.settings import read_yaml

MODEL = Path("artifacts/identify_control/arm.xml")
SETTINGS = Path("studies/payload/payload.yaml")
FIGURE = Path("docs/results/payload.png")
QUICK = {
    "grids": [{"supports": ["hanging"], "shapes": ["cylinder", "box", "sphere", "toy"], "diameters": [0.03, 0.06],
               "frictions": [0.45], "pulls": ["dorsal"], "shortenings": [0.2]}],
    "masses": [0.1, 0.3, 0.6], "wraps": [0.6], "placements": 1,
}  # fmt: skip
KEYS, FOUND = ([field.name for field in fields(kind)] for kind in (Cell, HeaviestMass))


def read_settings(quick: bool) -> PayloadSettings:
    values = OmegaConf.to_container(read_yaml(SETTINGS))
    assert isinstance(values, dict)
    return validated(PayloadSettings, values | (QUICK if quick else {}), SETTINGS)


def name_of(cell: Cell) -> str:
    return " ".join(map(str, astuple(cell)))


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--cells", type=int, default=sys.maxsize)
    options = parser.parse_args()
    chart, arm = read_settings(options.quick), read_spec(MODEL)
    settings = {key: value for key, value in asdict(chart).items() if key != "grids"}  # of those rows tell
    made_of = digest((sorted(settings.items()), IMPRATIO, SOLREF, SOLIMP), MODEL)
    rows = None if options.quick else Rows("payload", made_of, "cell")
    outcomes = {} if rows is None else rows.read()
    todo = [cell for cell in cells(chart) if name_of(cell) not in outcomes][: options.cells]
    begun, grasps = time.process_time(), 0
    with progress(len(todo), "payload", "cells") as bar:
        for cell in todo:
            outcome = heaviest(arm, chart, cell)
            found = {name: float(f"{value:.6g}") if isinstance(value, float) else value
                     for name, value in (asdict(cell) | asdict(outcome)).items()}  # fmt: skip
            outcomes[name_of(cell)] = found
            if rows is not None:
                rows.add(name_of(cell), **found)
            grasps += outcome.grasps
            bar.update(1, last=f"{cell.support} {cell.shape} {1e3 * cell.diameter:.0f} mm: {1e3 * outcome.mass:.0f} g")
    if outcomes:
        table = pd.DataFrame(list(outcomes.values()))
        is_whole = rows is not None and len(table) == len(cells(chart))
        if is_whole:
            save_figure(payload_figure(table), FIGURE)
        with contextlib.nullcontext() if rows is None else rows.recorded(is_whole):
            print(table[[*KEYS, *FOUND]].to_string(index=False))
    if grasps:
        print(f"{grasps} grasps, {(time.process_time() - begun) / grasps:.2f} s of processor each")
    return 0


if __name__ == "__main__":
    sys.exit(main())
