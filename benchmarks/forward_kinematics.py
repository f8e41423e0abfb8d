"""Forward kinematics side by side: solving for equilibria against stepping MuJoCo until it rests; lengths polished.

    python -m benchmarks.forward_kinematics [arm.xml]

Same arm, same targets, same threads (TRUNKLINE_THREADS). Compilation is not counted.
"""

import sys
import time
from pathlib import Path

import numpy as np

from trunkline.compute.threads import thread_count
from trunkline.frames import gravity_in_base
from trunkline.kinematics.dataset.sampling import pull_directions, sample_at
from trunkline.kinematics.ik.refine import refine
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import equilibrium, forward
from trunkline.model_files import read_model
from upkeep.results import recorded

SETTLED, SOLVED, DIRECTIONS, STEPS = 48, 1000, 72, 100


@recorded("forward_kinematics")
def main(path: Path) -> None:
    model = read_model(path)
    chain = read_chain(model).smooth
    rng = np.random.default_rng(0)
    tensions = pull_directions(chain, rng.uniform(0, 2 * np.pi, SOLVED)) * rng.uniform(0, 1, (SOLVED, 1)) ** 2
    gravity = gravity_in_base(rng.uniform(0, np.radians(120), SOLVED))
    rest = equilibrium(chain, tensions, gravity)
    forward(chain, rest.lengths[:2], gravity[:2])  # compiles
    sample_at(chain, gravity_in_base(0.5), 8, 8, rng)
    refine(chain, np.column_stack([np.zeros(2), rest.position[:2], rest.quaternion[:2]]), rest.lengths[:2])

    print(f"{path}: {chain.units} units, {chain.tendons} tendons, {thread_count()} threads")
    few = slice(0, SETTLED)
    commands = rest.lengths[few] - tensions[few] / chain.gain
    settled = timed("MuJoCo stepped until it rests", SETTLED, lambda: settle(model, commands, gravity[few]))
    timed("statics, tensions given, from rest", SOLVED, lambda: equilibrium(chain, tensions, gravity))
    found = timed("statics, lengths given, from rest", SOLVED, lambda: forward(chain, rest.lengths, gravity))
    count, tilted = DIRECTIONS * STEPS + 8 * STEPS, gravity_in_base(0.5)
    timed("statics, along paths (as fk_dataset)", count, lambda: sample_at(chain, tilted, DIRECTIONS, STEPS, rng))
    around = rest.lengths + 1e-3 * rng.uniform(-1, 1, rest.lengths.shape)
    targets = np.column_stack([np.arctan2(gravity[:, 0], -gravity[:, 2]), rest.position, rest.quaternion])
    exact = timed("Gauss-Newton polish of lengths 1 mm off", SOLVED, lambda: refine(chain, targets, around))
    print(f"polished: {(exact.position_error <= 1e-3 * chain.length).mean():.1%} within 0.1 % of the arm's length")
    deviation = np.linalg.norm(settled.position - found.position[few], axis=1) * 1e3
    print(f"tips of the first and the third: median {np.median(deviation):.2g} mm, max {deviation.max():.2g} mm apart")


def timed(name: str, count: int, work):
    """Run `work`, print its rate, return its result."""
    started = time.perf_counter()
    result = work()
    seconds = time.perf_counter() - started
    print(f"{name:40s} {count / seconds:12.1f} samples/s   ({count} in {seconds:.2f} s)")
    return result


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "artifacts/identify_control/arm.xml"))
