"""`python -m studies.rigid_labels`: the rigid map and its labels against mink, on the maker's own Panda.

The stage `reachability` labels points by a solver of our own, on our own kinematics and collisions. Here mink solves
the same task, on the Panda of `studies.franka_panda`, with contacts of MuJoCo. It is not told what the map or the
labels say, and every point gets as many starts. Points are those that the stage draws. What mink does not find within
its starts counts as unreachable, unless our solver's joint angles hold on that other Panda: those are a proof.
"""

import argparse
import time
from pathlib import Path

import mink
import mujoco
import numpy as np

from stages.reachability import Config
from studies.franka_panda import panda
from trunkline.kinematics.panda.collision import clearance
from trunkline.kinematics.panda.inverse import POSITION_TOLERANCE, ROTATION_TOLERANCE, solve
from trunkline.kinematics.panda.labels import draw_points, label
from trunkline.kinematics.reachability.maps import build_rigid
from trunkline.kinematics.sdf.mesh import contains
from trunkline.pipeline.config import load_config
from upkeep.results import recorded

STEPS = 60  # per start
PATIENCE = 12  # steps without getting a tenth nearer, after which a start is given up
LOOSENESS = 2  # times the tolerance, for joint angles that another solver found to the tolerance


class Mink:
    """mink on one Panda: joint angles that bring the mount to a point, straight down, any yaw, without collisions."""

    def __init__(self, model: mujoco.MjModel):
        self.configuration = mink.Configuration(model)
        self.task = mink.FrameTask(
            "mount", "site", position_cost=1.0, orientation_cost=[1.0, 1.0, 0.0], lm_damping=1e-3
        )
        self.limits = [mink.ConfigurationLimit(model)]

    def solve(self, point: np.ndarray, starts: int, seed: list[int]) -> np.ndarray | None:
        """Joint angles (7,), rad, at `point` (3,), m, from the first of `starts` random ones that ends there."""
        low, high = self.configuration.model.jnt_range.T
        rng = np.random.default_rng(seed)
        down = mink.SO3.from_matrix(np.diag([1.0, -1.0, -1.0]))
        self.task.set_target(mink.SE3.from_rotation_and_translation(down, point))
        ends = (self._descend(rng.uniform(low, high), point) for _ in range(starts))
        return next((q for q in ends if q is not None), None)

    def _descend(self, q: np.ndarray, point: np.ndarray) -> np.ndarray | None:
        self.configuration.update(q)
        best, since = np.inf, 0
        for _ in range(STEPS):
            away, tilt = errors(self.configuration.data, point)
            if away <= POSITION_TOLERANCE and tilt <= ROTATION_TOLERANCE:
                return self.configuration.q if self.holds(self.configuration.q, point, 1.0) else None
            best, since = (away + tilt, 0) if away + tilt < 0.9 * best else (best, since + 1)
            if since > PATIENCE:
                return None
            velocity = mink.solve_ik(self.configuration, [self.task], 1.0, "daqp", damping=1e-6, limits=self.limits)
            self.configuration.integrate_inplace(velocity, 1.0)
        return None

    def holds(self, q: np.ndarray, point: np.ndarray, looseness: float) -> bool:
        """Whether `q` (7,), rad, keeps the limits, brings the mount to `point` straight down, and nothing touches."""
        model = self.configuration.model
        data = mujoco.MjData(model)
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        low, high = model.jnt_range.T
        away, tilt = errors(data, point)
        near = away <= looseness * POSITION_TOLERANCE and tilt <= looseness * ROTATION_TOLERANCE
        return bool(near and ((q >= low - 1e-9) & (q <= high + 1e-9)).all() and data.ncon == 0)


def errors(data: mujoco.MjData, point: np.ndarray) -> tuple[float, float]:
    """Of the mount: distance to `point` in m, and angle off straight down in rad."""
    site = data.site("mount")
    axis = site.xmat.reshape(3, 3)[:, 2]
    return float(np.linalg.norm(site.xpos - point)), float(np.arctan2(np.hypot(axis[0], axis[1]), -axis[2]))


def turned(mink_on: Mink, q: np.ndarray, point: np.ndarray) -> bool:
    """Whether `q` holds with its last joint, which turns nothing but the yaw, at some angle."""
    low, high = mink_on.configuration.model.jnt_range[-1]
    return any(mink_on.holds(np.append(q[:-1], angle), point, LOOSENESS) for angle in np.linspace(low, high, 25))


@recorded("rigid_labels")
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=2000)
    parser.add_argument("--starts", type=int, default=15, help="of mink, for every point")
    arguments = parser.parse_args()
    config = load_config(Config, "reachability", Path(__file__).parents[1])
    rigid, labels, seed = config.rigid, config.labels, config.seed
    how = {"mount_offset": rigid.mount_offset, "avoid_collisions": rigid.self_collision}

    mesh = build_rigid(rigid, config.most_triangles, seed=seed).mesh
    low, high = mesh.vertices.min(axis=0) - labels.margin, mesh.vertices.max(axis=0) + labels.margin
    points = draw_points(low, high, labels.count, seed)[:arguments.points]
    claimed = contains(mesh, points)
    ours = label(points, seed=seed, starts=labels.starts, starts_in_doubt=labels.starts_in_doubt, **how)

    started = time.process_time()
    solver = Mink(panda(rigid.mount_offset))
    solved = [solver.solve(point, arguments.starts, [seed, i]) for i, point in enumerate(points)]
    found = np.array([q is not None for q in solved])
    seconds = time.process_time() - started
    poses = solve(points, seed=seed, starts=labels.starts, **how)
    proven = found | np.array([
        success and turned(solver, q, point) for q, success, point in zip(poses.q, poses.success, points, strict=True)
    ])

    missed = [q for q, of_ours in zip(solved, ours, strict=True) if q is not None and not of_ours]
    touching = sum(clearance(np.array(missed), rigid.mount_offset) <= 0) if missed else 0
    print(f"| {len(points)} points, {arguments.starts} starts of mink each | mink | mink, or a proof |")
    print("|---|---:|---:|")
    for name, values in (("the map", claimed), ("the stage's labels", ours)):
        shares = f"{np.mean(values == found):.4f} | {np.mean(values == proven):.4f}"
        print(f"| share on which {name} and it agree | {shares} |")
    print(f"| reachable | {found.sum()} | {proven.sum()} |")
    print(f"| called reachable by the stage, not by it | {(ours & ~found).sum()} | {(ours & ~proven).sum()} |")
    print(f"| found by it, called unreachable by the stage | {(found & ~ours).sum()} | {(proven & ~ours).sum()} |")
    print(f"| of those, in a pose that the stage's simpler shapes rule out | {touching} | {touching} |")
    print(f"| processor time of mink, s | {seconds:.0f} | |")


if __name__ == "__main__":
    main()
