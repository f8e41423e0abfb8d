"""A million poses to a closed mesh; the Panda's inverse kinematics beside mink's. `python -m benchmarks.rigid_map`"""

import argparse
import time
from pathlib import Path

import mink
import numpy as np

from stages.reachability import Config
from trunkline.panda.downward import sample_downward
from trunkline.panda.inverse import POSITION_TOLERANCE, ROTATION_TOLERANCE, solve
from trunkline.panda.kinematics import Q_MAX, Q_MIN, mount_pose
from trunkline.panda.mjcf import panda_spec
from trunkline.pipeline.config import load_config
from trunkline.reachability.maps import RigidSettings, build_rigid

STARTS = 60
MINK_STARTS = 10
MINK_STEPS = 200
MINK_RATE = 1.0  # s a step: the whole error is aimed at


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=10_000, help="for the batched solver")
    parser.add_argument("--single", type=int, default=200, help="targets solved one at a time")
    parser.add_argument("--mink", type=int, default=20, help="targets for mink")
    arguments = parser.parse_args()
    settings = RigidSettings(**vars(load_config(Config, "reachability", Path(__file__).parents[1]).rigid))

    started = time.perf_counter()
    rigid = build_rigid(settings, 8000, seed=0)
    seconds = time.perf_counter() - started
    print(f"{settings.poses} poses to a mesh of {len(rigid.mesh.faces)} triangles: {seconds:.1f} s, "
          f"closed: {rigid.mesh.is_closed()}")

    q = sample_downward(arguments.targets, 1, settings.mount_offset)[:arguments.targets]
    positions, rotations = mount_pose(q, settings.mount_offset)
    started = time.perf_counter()
    result = solve(positions, rotations, seed=0, starts=STARTS, mount_offset=settings.mount_offset)
    seconds = time.perf_counter() - started
    errors = result.position_error[result.success], result.rotation_error[result.success]
    print(f"batched: {100 * result.success.mean():.2f} % of {len(q)} poses solved, "
          f"{1e6 * seconds / len(q):.0f} us each, "
          f"worst {1e3 * errors[0].max():.4f} mm and {1e3 * errors[1].max():.4f} mrad")

    times = [_timed(lambda i=i: solve(positions[i:i + 1], rotations[i:i + 1], seed=0, starts=STARTS,
                                      mount_offset=settings.mount_offset)) for i in range(arguments.single)]
    print(f"one at a time: median {1e3 * np.median(times):.1f} ms")

    configuration = mink.Configuration(panda_spec(settings.mount_offset).compile())
    solved, times = 0, []
    for i in range(arguments.mink):
        started = time.perf_counter()
        solved += _mink_solves(configuration, positions[i], rotations[i], np.random.default_rng(i))
        times.append(time.perf_counter() - started)
    print(f"mink, one at a time: {solved} of {arguments.mink} solved, median {1e3 * np.median(times):.0f} ms")


def _timed(call) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


def _mink_solves(configuration: mink.Configuration, position: np.ndarray, rotation: np.ndarray, rng) -> bool:
    """Whether mink, with the same kind of restarts, brings the mount to a pose."""
    task = mink.FrameTask("mount", "site", position_cost=1.0, orientation_cost=1.0, lm_damping=1e-3)
    task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3.from_matrix(rotation), position))
    limits = [mink.ConfigurationLimit(configuration.model)]
    for _ in range(MINK_STARTS):
        configuration.update(rng.uniform(Q_MIN, Q_MAX))
        for _ in range(MINK_STEPS):
            error = task.compute_error(configuration)
            near = np.linalg.norm(error[:3]) <= POSITION_TOLERANCE
            if near and np.linalg.norm(error[3:]) <= ROTATION_TOLERANCE:
                return True
            velocity = mink.solve_ik(configuration, [task], MINK_RATE, "daqp", damping=1e-6, limits=limits)
            configuration.integrate_inplace(velocity, MINK_RATE)
    return False


if __name__ == "__main__":
    main()
