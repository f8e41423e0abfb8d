"""Poses in several frames, as transform trees hold them, brought into one: composed along the tree, by time."""

from collections import Counter

import numpy as np

from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.recordings.logs.samples import PoseSamples

NORM_TOLERANCE = 0.01  # of a quaternion's length; float32 rounding is far below, anything above is no rotation
ALWAYS = np.iinfo(np.int64).min  # ns, since when a static transform holds


def in_one_frame(
    moving: PoseSamples, static: PoseSamples, parents: list[str], wanted: str | None
) -> tuple[PoseSamples, list[str]]:
    """The poses of `moving` in one frame, and its name.

    A parent is where its latest transform at or before the child's time puts it. A pose is NaN where there was none
    yet, or where one on the way is no rotation.

    Args:
        static: transforms that hold all the time.
        parents: the frames that `moving` are in.
        wanted: the frame; only what is below it is returned. By default the nearest that holds all of `parents`.

    Returns:
        `moving` as it is, and the roots, that of the most bodies first, where nothing connects them and no frame is
        wanted.

    Raises:
        ValueError: naming a frame with two parents, those that form a cycle, or a wanted one that is none of them.
    """
    above = _tree(moving, static)
    paths = {name: _path(name, above) for name in np.unique(moving.names).tolist()}
    target = wanted or _common([_path(parent, above) for parent in parents])
    if target is None:
        return moving, [root for root, _ in Counter(path[-1] for path in paths.values()).most_common()]
    if target not in above.values():
        frames = ", ".join(sorted(set(above.values())))
        raise ValueError(f"found poses in the frames {frames}, expected {target!r}, as in session.yaml: frame.name")
    moving = moving.take(np.isin(moving.names, [name for name, path in paths.items() if target in path[1:]]))
    time = np.concatenate([np.full(len(static.names), ALWAYS), moving.clock])
    names = np.concatenate([static.names, moving.names])
    places = np.concatenate([static.positions, moving.positions])
    turns = np.concatenate([static.quaternions, moving.quaternions])
    positions, quaternions = moving.positions.copy(), moving.quaternions.copy()
    for name in np.unique(moving.names).tolist():
        rows = np.flatnonzero(moving.names == name)
        for parent in paths[name][1 : paths[name].index(target)]:
            transforms = np.flatnonzero(names == parent)
            transforms = transforms[np.argsort(time[transforms], kind="stable")]
            latest = np.searchsorted(time[transforms], moving.clock[rows], side="right") - 1
            outer = transforms[np.maximum(latest, 0)]
            there = np.where(latest[:, None] < 0, np.nan, turns[outer])
            positions[rows], quaternions[rows] = _product(places[outer], there, positions[rows], quaternions[rows])
    return moving._replace(positions=positions, quaternions=quaternions), [target]


def is_rotation(quaternions: np.ndarray) -> np.ndarray:
    """Which of (..., 4) have length one; NaN has not."""
    return np.abs(np.linalg.norm(quaternions, axis=-1) - 1) < NORM_TOLERANCE


def _tree(*transforms: PoseSamples) -> dict[str, str]:
    """Frame to its parent."""
    above: dict[str, str] = {}
    for samples in transforms:
        for frame, parent in dict.fromkeys(zip(samples.names.tolist(), samples.parents.tolist(), strict=True)):
            if above.setdefault(frame, parent) != parent:
                both = " and ".join(sorted([above[frame], parent]))
                raise ValueError(f"found {frame!r} in the frames {both}, expected one of them")
    for frame in above:
        _path(frame, above)
    return above


def _path(frame: str, above: dict[str, str]) -> list[str]:
    """The frame, its parent, and so on up to the root."""
    path = [frame]
    while path[-1] in above:
        path.append(above[path[-1]])
        if path[-1] in path[:-1]:
            raise ValueError(f"found a cycle of frames, {' in '.join(path)}, expected a tree")
    return path


def _common(paths: list[list[str]]) -> str | None:
    """The first frame that is on all ways up; None if there is none."""
    return next((frame for frame in paths[0] if all(frame in path for path in paths)), None)


def _product(places, turns, positions, quaternions) -> tuple[np.ndarray, np.ndarray]:
    """Poses in a frame that is itself at `places` (n, 3), `turns` (n, 4)."""
    placed, turned = np.full(positions.shape, np.nan), np.full(quaternions.shape, np.nan)
    good = is_rotation(turns)
    placed[good] = places[good] + rotation_from_wxyz(turns[good]).apply(positions[good])
    good &= is_rotation(quaternions)
    turned[good] = wxyz_from_rotation(rotation_from_wxyz(turns[good]) * rotation_from_wxyz(quaternions[good]))
    return placed, turned
