"""A run that is filmed is the same run, and what is drawn of it is where it is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.image import imread

from rehearsal.animation import _circle, _outlines, _projected, telling, write_gif
from rehearsal.film import Shot, filmed
from rehearsal.robot.scene import SceneObject

SPHERE = SceneObject("sphere", 0.06, 0.06, 0.1, [0.0, 0.0, 0.0])


def shot(now: float = 0.0, mode: str = "aim", object: SceneObject = SPHERE) -> Shot:
    heights = np.linspace(0.6, 0.1, 5)
    units = np.column_stack([np.full(5, 0.4), np.zeros(5), heights])
    ends = np.array([[0.4, 0.0, 0.6], [np.nan] * 3])
    return Shot(
        now, mode, np.zeros((9, 3)), np.array([0.4, 0.0, 0.62]), units, np.tile([0.0, 0.0, 1.0], (5, 1)),
        np.full(5, 0.02), np.array([[1.0, -0.2, 0.5], [1.0, 0.2, 0.5]]), ends, None, np.array([0.4, 0.1, 0.1]),
        np.array([1.0, 0.0, 0.0, 0.0]), None, object, [],
    )  # fmt: skip


def test_the_telling_moment_is_the_end_of_an_execution_or_the_midst_of_following():
    modes = ["aim", "preview", "execute", "execute", "aim"]
    assert telling([shot(mode=mode) for mode in modes]) == 3
    assert telling([shot(mode=mode) for mode in ["aim", *["follow"] * 5, "aim"]]) == 3
    assert telling([shot(mode="aim")] * 4) == 3


@pytest.mark.parametrize(("shape", "lines"), [("sphere", 3), ("cylinder", 6), ("box", 6), ("toy", 6)])
def test_outlines_are_as_large_as_the_object(shape, lines):
    object = SceneObject(shape, 0.06, 0.2, 0.1, [0.0, 0.0, 0.0])
    outlines = _outlines(shot(object=object))
    assert len(outlines) == lines
    points = np.concatenate(outlines) - shot().centre
    half = [0.03, 0.03, 0.03 if shape == "sphere" else 0.1]
    np.testing.assert_allclose(points.max(axis=0), half, atol=1e-9)
    np.testing.assert_allclose(points.min(axis=0), np.negative(half), atol=1e-9)


def test_a_basket_is_drawn_from_its_floor_to_its_bar():
    basket = SceneObject("basket", 0.03, 0.1, 0.1, [0.0, 0.0, 0.0])
    points = np.concatenate(_outlines(shot(object=basket))) - shot().centre
    assert points[:, 2].min() == pytest.approx(-basket.half_height)
    assert points[:, 2].max() == pytest.approx(basket.grip[2] + 0.015)


def test_what_is_higher_is_drawn_higher_and_lengths_in_the_picture_s_plane_are_kept():
    low, high = _projected(np.array([[0.3, 0.2, 0.0], [0.3, 0.2, 0.5]]))
    assert low[0] == pytest.approx(high[0])
    assert high[1] > low[1] + 0.4
    corners = _projected(np.eye(3))
    assert np.linalg.norm(corners) ** 2 == pytest.approx(2.0), "two of three directions"
    ring = _circle(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.1)
    np.testing.assert_allclose(np.linalg.norm(ring, axis=1), 0.1)


def test_a_film_has_a_picture_a_shot(tmp_path):
    shots = [replace(shot(now=0.1 * n, mode="execute"), previewed=np.array([0.4, 0.1, 0.1])) for n in range(3)]
    write_gif(shots, "reach", tmp_path / "reach.gif")
    film = (tmp_path / "reach.gif").read_bytes()
    assert film.startswith(b"GIF89a")
    assert film.count(b"\x21\xf9\x04") == 3, "a graphic control block before each picture"
    assert imread(tmp_path / "reach.gif").std() > 10, "something is drawn"


def test_whatever_session_is_staged_is_filmed_every_fifth_frame(monkeypatch):
    monkeypatch.setattr("rehearsal.film.shoot", lambda session, mode: (session.now, mode))
    session = SimpleNamespace(now=0)

    def frame():
        session.now += 1
        return SimpleNamespace(intent=SimpleNamespace(mode="aim"))

    session.frame = frame
    shots = filmed(session)
    for _ in range(11):
        session.frame()
    assert shots == [(1, "aim"), (6, "aim"), (11, "aim")]
