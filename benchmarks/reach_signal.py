"""What a headset does every frame: two soft grids blended to a new gravity angle. `python -m benchmarks.reach_signal`

Random grids of 64 cubed, as they are packed (16-bit floats) and as they are kept to blend fast (32-bit), on one thread.
"""

import time

import numpy as np

from trunkline.kinematics.reachability.reach_signal import packed, reach_signal
from trunkline.kinematics.sdf.grid import Lattice, blend
from upkeep.results import recorded

POINTS, ROUNDS = 64, 200
ANGLES = np.radians([0.0, 5.0])


@recorded("reach_signal")
def main() -> None:
    rng = np.random.default_rng(0)
    fields = rng.normal(size=(2, POINTS, POINTS, POINTS)).astype(np.float32)
    lattice = Lattice(np.zeros(3), 0.01, fields.shape[1:])
    target = rng.uniform(0.1, 0.5, (1, 3))
    halves = packed(fields)
    for name, work in (
        ("blend of 32-bit grids", lambda: blend(fields, ANGLES, 0.03)),
        ("blend of 16-bit grids, unpacked first", lambda: blend(halves.astype(np.float32), ANGLES, 0.03)),
        ("signal at a point, whole grids blended", lambda: reach_signal(halves, ANGLES, lattice, target, 0.03)),
    ):
        times = []
        for _ in range(ROUNDS):
            started = time.perf_counter()
            work()
            times.append(time.perf_counter() - started)
        print(f"{name:40s} {1e3 * np.median(times):6.2f} ms median of {ROUNDS}, {POINTS}³ points")


if __name__ == "__main__":
    main()
