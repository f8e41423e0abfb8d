"""What the shares of the maps' checks count: which tips are called reachable, and which points beyond reach are."""

from types import SimpleNamespace

import numpy as np
import pytest

from trunkline.frames import downwards
from trunkline.kinematics.reachability import reach_signal, surface_check
from trunkline.kinematics.reachability.reach_signal import held_out, points_beyond
from trunkline.kinematics.reachability.surface_check import check_surfaces
from trunkline.kinematics.sdf.grid import Lattice

A_LITTLE = 1e-9
SIGNALS = [
    ([-0.1, -0.2], [0.1, 0.2], 1.0, 0.0),
    ([0.0, A_LITTLE], [0.1, 0.2], 0.5, 0.0),  # on the border is within reach
    ([-0.1, -0.2], [0.1, 0.0], 1.0, 0.5),
    ([0.1, 0.2], [-0.1, -0.2], 0.0, 1.0),
    ([-0.1, -0.2, np.nan, 0.1], [0.1, np.nan, -0.1, -0.2], 0.5, 0.5),  # what has no signal is not called within reach
]


@pytest.mark.parametrize(("at_tips", "outside", "reachable", "beyond"), SIGNALS)
def test_a_held_out_angle_counts_what_its_signal_calls_within_reach(monkeypatch, at_tips, outside, reachable, beyond):
    tips, away = np.zeros((len(at_tips), 3)), np.ones((len(outside), 3))
    monkeypatch.setattr(reach_signal, "soft_field", lambda *_: -np.ones((2, 2, 2)))
    monkeypatch.setattr(reach_signal, "points_beyond", lambda *_: away)
    monkeypatch.setattr(
        reach_signal, "reach_signal", lambda fields, angles, lattice, points, angle: np.array(
            at_tips if points is tips else outside
        ),
    )  # fmt: skip
    lattice = Lattice(np.zeros(3), 0.1, (2, 2, 2))
    fields, angles = -np.ones((2, 2, 2, 2), np.float16), np.array([0.0, 1.0])
    check = held_out(fields, angles, lattice, None, tips, 0.5, beyond=0.02, count=9, seed=1)  # type: ignore[arg-type]
    assert (check.angle, check.iou, check.reachable, check.beyond) == (0.5, 1.0, reachable, beyond)


@pytest.mark.parametrize(("at_tips", "outside", "reachable", "beyond"), SIGNALS)
def test_sheets_are_checked_with_tips_and_points_beyond(monkeypatch, at_tips, outside, reachable, beyond):
    """At as many directions as are asked for, none farther aside than those of the sheets."""
    tips, away = np.zeros((len(at_tips), 3)), np.ones((len(outside), 3))
    found_there = SimpleNamespace(equilibrium=SimpleNamespace(position=tips))
    for name, value in (
        ("finer", np.zeros((3, 3))), ("workspace_surface_at", None), ("soft_lattice", None), ("soft_field", None),
        ("overlap", 0.75), ("points_beyond", away), ("sample_at", found_there),
    ):  # fmt: skip
        monkeypatch.setattr(surface_check, name, lambda *_, value=value, learnt=None: value)
    sheets = SimpleNamespace(
        downs=downwards(np.array([0.0, 0.5]), np.zeros(2)), points=np.zeros((2, 4, 5, 3)), at=lambda down: down,
        signal=lambda sheet, points: np.array(outside if points is away else at_tips),
    )  # fmt: skip
    soft = SimpleNamespace(sheets=SimpleNamespace(heldout=3), voxel=0.01)
    calls = []
    rows = check_surfaces(sheets, None, soft, beyond=0.02, count=9, seed=1, done=calls.append)  # type: ignore[arg-type]
    assert len(rows) == len(calls) == 3
    assert [(row.reachable, row.beyond, row.iou) for row in rows] == [(reachable, beyond, 0.75)] * 3
    assert all(0 <= row.angle <= 0.5 for row in rows)


def test_points_beyond_are_a_little_more_than_the_distance_from_their_nearest_tip():
    rng = np.random.default_rng(0)
    tips = rng.uniform(-0.1, 0.1, (200, 3))
    points = points_beyond(tips, 0.03, 150, rng)
    nearest = np.linalg.norm(points[:, None] - tips, axis=2).min(axis=1)
    assert len(points) == 150
    assert (nearest >= 0.03).all()
    assert (nearest <= 0.033 + 1e-12).all()
