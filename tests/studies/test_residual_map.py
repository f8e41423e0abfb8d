"""The study of recorded poses: what its table says of maps that are right, and of none."""

import numpy as np

from studies.residual_map import learned, row
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses

MM = 1e-3


def test_a_row_has_all_poses_those_within_and_those_in_the_radius():
    rng = np.random.default_rng(0)
    poses = RestingPoses(rng.uniform(0, 0.04, (40, 3)), np.tile([0.0, 0.0, -9.81], (40, 1)))
    residuals = 0.1 * poses.pulls + 0.1 * MM * rng.standard_normal((40, 3))
    fitted = ResidualMap.fit(poses[:20], residuals[:20], 0.5)
    others, rest = poses[20:], residuals[20:].copy()
    rest[0] += [1.0, 0.0, 0.0]  # m: beyond any radius
    within = np.arange(20) > 9
    name, both, _, share, _ = learned([fitted, fitted], "20 poses", others, rest, within).strip("| ").split(" | ")
    without = row("nothing", rest, within).split(" | ")[1]
    assert name == "20 poses"
    assert float(both.split(" / ")[0]) < 0.3 * float(without.split(" / ")[0])
    assert float(share.removesuffix(" %")) <= 95
    three = row("nothing", MM * np.eye(3), np.array([True, True, False]))
    assert three == "| nothing | 1.0 / 1.0 | 1.0 / 1.0 | – | – |"
