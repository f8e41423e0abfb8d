"""One step of the teleoperation core, all modes, with the reachability maps that the pipeline made, on one thread.

    python -m benchmarks.teleop_step [artifacts/reachability/grids.npz]

The hands tremble and both grips are held. Out of reach, the nearest points are looked for at every step, which takes
longest. Once the end effector is tilted, gravity turns at every step; what a tip's reach then takes is timed apart.
60 Hz leaves 16.7 ms.
"""

import sys
import time
from pathlib import Path

import numpy as np

from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Controller, Input, Pose, World, to_json
from trunkline.ar.teleop.reach import MapReach
from trunkline.frames import downwards
from trunkline.pipeline.config import PROJECT, load_folder
from upkeep.results import recorded

STEPS, DT = 1200, 1 / 60
JOINTS = (0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785)
UPRIGHT = Pose((0.0, 0.0, 1.0), (0.5, 0.5, -0.5, -0.5))  # the reference's y is up, its -z forward
PLACES = {"within reach": ((0.0, -0.4, 0.0), (0.1, -0.75, -0.1)), "out of reach": ((0.0, 0.3, -0.4), (0.5, 0.0, -0.4))}


@recorded("teleop_step")
def main(path: Path) -> None:
    config = load_folder(TeleoperationConfig, PROJECT / "conf/teleop")
    started = time.perf_counter()
    with np.load(path) as arrays:
        reach = MapReach.from_arrays(dict(arrays))
    print(f"{path}: read in {time.perf_counter() - started:.1f} s")
    for name, places in PLACES.items():
        core = Teleoperation(config.core, reach, "digest", config.mount_offset)
        state, times, sizes = core.start(), [], []
        rng = np.random.default_rng(0)
        for index in range(STEPS):
            hands = [trembling(place, rng, grip=index > 60) for place in places]
            given = Input(DT * (1 + index), hands[0], hands[1], UPRIGHT, JOINTS, World("world"), "digest")
            began = time.thread_time()
            state, intent = core.step(state, given, DT)
            times.append(time.thread_time() - began)
            sizes.append(len(to_json(intent)))
        assert intent.targets is not None
        reached = f"{intent.targets.rigid.reach}, {intent.targets.tip.reach}"
        median, late = 1e3 * np.quantile(times[STEPS // 2 :], (0.5, 0.99))
        print(f"{name:12s} ({reached}): {median:.3f} ms of processor a step, median; {late:.3f} ms 99th percentile; "
              f"intents of {np.median(sizes):.0f} bytes")  # fmt: skip
    rng, times = np.random.default_rng(0), []
    for tilt, azimuth in rng.uniform((0.0, 0.0), (np.pi / 3, 2 * np.pi), (STEPS, 2)):
        x, y, z = (float(value) for value in downwards(tilt, azimuth))
        began = time.thread_time()
        reach.soft((0.1, 0.0, -0.2), (x, y, z))
        times.append(time.thread_time() - began)
    median, late = 1e3 * np.quantile(times, (0.5, 0.99))
    print(f"reach of a tip under a new gravity: {median:.3f} ms, median; {late:.3f} ms 99th percentile")


def trembling(place: tuple[float, float, float], rng: np.random.Generator, grip: bool) -> Controller:
    x, y, z = (float(value) for value in place + rng.normal(scale=1e-3, size=3))
    return Controller((x, y, z), (1.0, 0.0, 0.0, 0.0), grip=grip)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "artifacts/reachability/grids.npz"))
