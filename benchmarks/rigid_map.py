"""A million poses to a closed mesh; the Panda's kinematics, collisions and inverse kinematics beside the libraries'.

    python -m benchmarks.rigid_map

The mesh in seconds on every thread, all else in processor time on one. Poses: here in numpy, there in
`mujoco.batch` (its position stage) and in a loop of `mj_geomDistance` over the pairs of links.
"""

import argparse
import time
from pathlib import Path

import mink
import mujoco
import numpy as np
from mujoco.batch import Batch

from stages.reachability import Config
from trunkline.kinematics.panda.collision import CHUNK, clearance
from trunkline.kinematics.panda.downward import sample_downward
from trunkline.kinematics.panda.inverse import POSITION_TOLERANCE, ROTATION_TOLERANCE, solve
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN, mount_pose
from trunkline.kinematics.panda.mjcf import panda_spec
from trunkline.kinematics.reachability.maps import build_rigid
from trunkline.pipeline.config import load_config
from upkeep.results import recorded

STARTS = 60
MINK_STARTS = 10
GEOM_POSES = 200  # for the loop over pairs of links
MINK_STEPS = 200
MINK_RATE = 1.0  # s a step: the whole error is aimed at


@recorded("rigid_map")
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=10_000, help="for the batched solver")
    parser.add_argument("--single", type=int, default=200, help="targets solved one at a time")
    parser.add_argument("--mink", type=int, default=20, help="targets for mink")
    arguments = parser.parse_args()
    settings = load_config(Config, "reachability", Path(__file__).parents[1]).rigid

    started = time.perf_counter()
    rigid = build_rigid(settings, 8000, seed=0)
    seconds = time.perf_counter() - started
    print(f"{settings.poses} poses to a mesh of {len(rigid.mesh.faces)} triangles: {seconds:.1f} s, "
          f"closed: {rigid.mesh.is_closed()}")

    _poses_beside_mujoco(settings.mount_offset)

    q = sample_downward(arguments.targets, 1, settings.mount_offset)[:arguments.targets]
    positions, rotations = mount_pose(q, settings.mount_offset)
    started = time.process_time()
    result = solve(positions, rotations, seed=0, starts=STARTS, mount_offset=settings.mount_offset)
    seconds = time.process_time() - started
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
        started = time.process_time()
        solved += _mink_solves(configuration, positions[i], rotations[i], np.random.default_rng(i))
        times.append(time.process_time() - started)
    print(f"mink, one at a time: {solved} of {arguments.mink} solved, median {1e3 * np.median(times):.0f} ms")


def _poses_beside_mujoco(mount_offset: float) -> None:
    model = panda_spec(mount_offset).compile()
    q = np.random.default_rng(0).uniform(Q_MIN, Q_MAX, (CHUNK, 7))
    batch = Batch(model, nsim=CHUNK, nthread=1)
    qpos, position, contacts = batch.bind("qpos"), batch.bind("site_xpos"), batch.bind("ncon")
    qpos[:] = q
    batch.forward(stage=int(mujoco.mjtStage.mjSTAGE_POS))  # the first call makes room
    whole = _microseconds(CHUNK, lambda: batch.forward(stage=int(mujoco.mjtStage.mjSTAGE_POS)))
    mounts, gaps = mount_pose(q, mount_offset)[0], clearance(q, mount_offset)
    kinematics = _microseconds(CHUNK, lambda: mount_pose(q, mount_offset))
    collision = _microseconds(CHUNK, lambda: clearance(q, mount_offset))
    pairs = _microseconds(GEOM_POSES, lambda: _geom_gaps(model, q[:GEOM_POSES]))
    apart = np.abs(position.reshape(-1, 3) - mounts).max()
    same = ((contacts.ravel() > 0) == (gaps < 0)).mean()
    print(f"a pose: {kinematics:.2f} us to its mount, {collision:.2f} us to its clearance; mujoco.batch "
          f"{whole:.2f} us, mj_geomDistance {pairs:.1f} us\n"
          f"beside mujoco.batch: mounts {apart:.1e} m apart, the same verdict on {100 * same:.2f} % of {CHUNK} poses, "
          f"beside mj_geomDistance: {np.abs(_geom_gaps(model, q[:GEOM_POSES]) - gaps[:GEOM_POSES]).max():.1e} m apart")


def _geom_gaps(model: mujoco.MjModel, q: np.ndarray) -> np.ndarray:
    """Smallest gap between the paired geoms at each of `q` (N, 7), m. Shape (N,)."""
    data, far, ends = mujoco.MjData(model), 10.0, np.zeros(6)
    pairs = list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))
    gaps = np.empty(len(q))
    for row, pose in enumerate(q):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        gaps[row] = min(mujoco.mj_geomDistance(model, data, a, b, far, ends) for a, b in pairs)
    return gaps


def _microseconds(count: int, call) -> float:
    """Processor time of `call` for each of `count`."""
    started = time.process_time()
    call()
    return 1e6 * (time.process_time() - started) / count


def _timed(call) -> float:
    started = time.process_time()
    call()
    return time.process_time() - started


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
