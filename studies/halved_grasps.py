"""How many grasps turn out otherwise when the time step is halved: `python -m studies.halved_grasps --count 200`

Random grasps of the identified arm: shape, diameter, mass, friction, pull and the place of the object by uniform draws
about the grasp frame, hanging. Each is tried at the payload chart's step and at half of it. Prints both outcomes of
those that differ, the share that does with its Wilson 95 % interval, and how far objects that both hold end apart.
"""

import argparse
import contextlib
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np

from studies.payload import MODEL, read_settings
from trunkline.ar.hybrid.grasps import Pull
from trunkline.ar.hybrid.objects import Shape
from trunkline.ar.hybrid.payload import Cell, try_masses
from trunkline.ar.hybrid.rates import wilson
from trunkline.compute.progress import progress
from trunkline.errors import in_one_line
from trunkline.pipeline.inputs import read_spec
from upkeep.results import recorded

SHAPES, PULLS = get_args(Shape), get_args(Pull)
DIAMETERS, MASSES, FRICTIONS = (0.02, 0.08), (0.05, 0.5), (0.3, 0.6)  # m, kg
WRAPS, GAPS = (0.4, 0.9), (0.0, 0.03)  # turns, m
TOGETHER = 4  # placements of each draw
SPREAD = 0.01  # m, of them


@in_one_line
@recorded("halved_grasps")
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    chart, arm, rng = read_settings(False), read_spec(Path(MODEL)), np.random.default_rng(options.seed)
    begun, outcomes, apart, changes = time.process_time(), [], [], []
    draws = -(-options.count // TOGETHER)
    with contextlib.redirect_stdout(sys.stderr), progress(draws, "halved_grasps", "draws") as bar:
        for draw in range(draws):
            wrap = rng.uniform(*WRAPS)
            own = replace(chart, gap=rng.uniform(*GAPS), placements=TOGETHER, spread=SPREAD, seed=draw)
            cell = Cell("hanging", SHAPES[rng.integers(len(SHAPES))], rng.uniform(*DIAMETERS),
                        rng.uniform(*FRICTIONS), PULLS[rng.integers(len(PULLS))], 0.2)  # fmt: skip
            mass = np.array([rng.uniform(*MASSES)])
            whole, half = (
                try_masses(arm, replace(own, timestep=chart.timestep / part), cell, wrap, mass) for part in (1, 2)
            )
            held = [tried.success(chart.sag, chart.slip) for tried in (whole, half)]
            outcomes.append(np.column_stack(held))
            both = held[0] & held[1]
            apart.append(np.linalg.norm(whole.path[both, -1] - half.path[both, -1], axis=1))
            for one, other in outcomes[-1][held[0] != held[1]]:
                what = f"{cell.shape} {1e3 * cell.diameter:.0f} mm, {1e3 * mass[0]:.0f} g"
                changes.append(f"{what}: held {one}, half step {other}")
            bar.update(1)
    print("\n".join(changes))
    found, apart = np.concatenate(outcomes), np.concatenate(apart)
    changed, count = int((found[:, 0] != found[:, 1]).sum()), len(found)
    low, high = wilson(changed, count)
    print(
        f"{changed} of {count} grasps change outcome: {changed / count:.1%} ({low:.1%} to {high:.1%}); "
        f"{found[:, 0].mean():.0%} held at the whole step"
    )
    if len(apart):
        print(
            f"objects that both hold end {1e3 * np.median(apart):.1f} mm apart in the middle, "
            f"{1e3 * apart.max():.1f} mm at most"
        )
    print(f"{(time.process_time() - begun) / count:.2f} s of processor a grasp, both steps")
    return 0


if __name__ == "__main__":
    sys.exit(main())
