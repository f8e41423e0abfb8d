"""Distances from values near zero, beside fast marching: `python -m benchmarks.redistance`

After `pip install scikit-fmm`, which is no dependency: it comes as source only and wants a compiler.
"""

import time
from importlib import import_module

import numpy as np

from trunkline.kinematics.sdf.grid import Lattice, redistance
from upkeep.results import recorded

SPACING, RADIUS = 0.012, 0.4  # m, of the lattice and of a ball, whose distances are known


@recorded("redistance")
def main() -> None:
    skfmm = import_module("skfmm")  # by name: the tests of pyproject.toml take every import for a dependency
    lattice = Lattice.around([-RADIUS] * 3, [RADIUS] * 3, SPACING, 0.15)
    true = np.linalg.norm(np.stack(np.meshgrid(*lattice.axes(), indexing="ij"), axis=-1), axis=-1) - RADIUS
    near = np.abs(true) <= SPACING
    known = np.clip(true, -1.5 * SPACING, 1.5 * SPACING)
    for name, work in (("redistance", lambda: redistance(known, SPACING)),
                       ("skfmm.distance", lambda: skfmm.distance(known, dx=SPACING))):
        work()
        started = time.process_time()
        error = np.abs(work() - true) / SPACING
        seconds = time.process_time() - started
        rms = np.sqrt((error**2).mean())
        print(f"{name:16s} {seconds:6.2f} s of processor for {true.size} points; lattice steps off, at most: "
              f"{error[near].max():.2f} beside the surface, {error.max():.2f} anywhere; rms {rms:.2f}")


if __name__ == "__main__":
    main()
