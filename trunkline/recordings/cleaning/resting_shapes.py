"""Where arms rest that nothing pulls, by their mounts' tilts: whether base, vertical and frame can be those of an arm.

To first order an arm sags by one share of the part of gravity across it, whichever way it is mounted. What rests of it
without gravity is how its base's axes lie to it; a trial that does not fit has another vertical than the others.
"""

import numpy as np

from trunkline.recordings.cleaning.checks import Findings, deciding
from trunkline.recordings.cleaning.described_arm import Places
from trunkline.recordings.cleaning.gravity_direction import AXES, show_axis
from trunkline.recordings.signals.base_frame import average_base, to_base_frame
from trunkline.recordings.trials.experiments import EXPERIMENTS, TILT, is_stepwise
from trunkline.recordings.trials.raw_trial import RawTrial

FEWEST, SPREAD = 3, 0.3  # shapes, and root of the squares of gravity across them, in g, from which a sag is told
ASKEW = np.radians(6.5)  # of the base's axes to the arm, more than bodies are made askew by hand, or arms are bent
OTHER = np.radians(7)  # by which a trial rests elsewhere than its tilt explains
EXPLAINED = 1 / 3  # of that, which another vertical leaves at most
STANDS = 0.1  # of gravity, along z of a base, from which on an arm may bend over to any side

Shape = tuple[np.ndarray, np.ndarray, np.ndarray]


def check_resting_shapes(raw_trials: list[RawTrial], findings: list[Findings], arm: Places, base: str | None) -> None:
    """Warn of a base whose axes are askew to the arm, and of trials that rest as with another vertical.

    Args:
        arm: the described one. base: the name of the body that marks the mount, None where none does.
    """
    shapes = {raw.name: shape for raw in raw_trials if (shape := _resting_shape(raw, arm)) is not None}
    splits = {raw.name: raw.split for raw in raw_trials}
    chosen, _ = deciding(shapes, splits.__getitem__)
    records = {raw.name: record for raw, record in zip(raw_trials, findings, strict=True)}
    ups = {raw.name: raw.up for raw in raw_trials}
    left = dict(shapes)
    while True:
        others = {
            name: other
            for name, shape in left.items()
            if (fit := _sags([left[some] for some in chosen if some in left and some != name])) is not None
            and (other := _other_vertical(shape, *fit)) is not None
        }
        if not others:
            break
        worst = max(others, key=lambda name: others[name][0])  # which spoils what the rest is compared with
        del left[worst]
        off, leaves, axis = others[worst]
        problem = f"the arm rests {np.degrees(np.arcsin(min(off, 1.0))):.0f}° from where the other trials have it with"
        records[worst].warnings.append(
            f"up: {problem} {show_axis(ups[worst])} up, {np.degrees(np.arcsin(leaves)):.0f}° with {show_axis(axis)}: "
            "are its poses in another frame? expected one in a session"
        )
    fit = _sags([left[name] for name in chosen if name in left])
    if fit is None or np.linalg.norm(fit[1]) <= np.sin(ASKEW):
        return
    angle = np.degrees(np.arcsin(min(float(np.linalg.norm(fit[1])), 1.0)))
    where = "`base` in session.yaml" if base is None else f"{base!r}"
    problem = f"in the axes of {where} the arm rests {angle:.0f}° from where it is described, gravity taken off"
    remedy = "expected z back along the arm: are the axes of that body the arm's, or is the arm bent by itself?"
    for record in findings:
        record.warnings.append(f"base: {problem}, {remedy}")


def _resting_shape(raw: RawTrial, arm: Places) -> Shape | None:
    """(direction to the farthest marker less the described one, across the arm, (2,); down in the base's axes (3,), the
    rotation matrix of the base (3, 3)); None of an arm that does not rest freely, or is not described."""
    rows, farthest = _freely(raw), max(arm, key=lambda name: float(np.linalg.norm(arm[name])), default="")
    if rows is None or farthest not in raw.markers or not raw.up.any():
        return None
    mount = average_base(raw.base_positions, raw.base_quaternions)
    place = to_base_frame(mount, raw.positions[rows, raw.markers.index(farthest)][:, None], None)[0][:, 0]
    if not np.isfinite(place).any():
        return None
    place = np.nanmedian(place, axis=0)
    along = arm[farthest] / np.linalg.norm(arm[farthest])
    down = mount.rotation.inv().apply(-raw.up)
    if along[2] > -0.9 or down[2] > STANDS or not np.linalg.norm(place) > 0:
        return None
    return (place / np.linalg.norm(place) - along)[:2], down, mount.rotation.as_matrix()


def _freely(raw: RawTrial) -> slice | None:
    """The frames in which an arm rests freely: of a tilt all, of a release the last; tendons may hold any other."""
    kind = EXPERIMENTS[raw.experiment]
    if raw.load or kind.needs_motors or is_stepwise(raw.experiment):
        return None
    return slice(-max(1, len(raw.time) // 5), None) if kind.hangs else slice(None) if kind.level is TILT else None


def _sags(shapes: list[Shape]) -> tuple[float, np.ndarray] | None:
    """(share of gravity across it by which an arm sags, where it rests without (2,)); None where tilts are alike."""
    if len(shapes) < FEWEST:
        return None
    sags, across = np.array([sag for sag, *_ in shapes]), np.array([down[:2] for _, down, _ in shapes])
    spread = across - across.mean(axis=0)
    size = float(np.sum(spread**2))
    if np.sqrt(size) < SPREAD:
        return None
    share = float(np.sum(spread * (sags - sags.mean(axis=0)))) / size
    return share, sags.mean(axis=0) - share * across.mean(axis=0)


def _other_vertical(shape: Shape, share: float, rest: np.ndarray) -> tuple[float, float, np.ndarray] | None:
    """(by how much a trial rests elsewhere than others, of the arm's length; what the best of `AXES` up leaves of it;
    that axis (3,)); None where nothing is off, or no axis explains it."""
    sag, down, mount = shape
    off = float(np.linalg.norm(sag - rest - share * down[:2]))
    if off <= np.sin(OTHER):
        return None
    left = np.linalg.norm(sag - rest + share * (AXES @ mount)[:, :2], axis=1)
    left[-AXES @ mount @ [0, 0, 1] > STANDS] = np.inf
    best = int(np.argmin(left))
    return None if left[best] > EXPLAINED * off else (off, float(left[best]), AXES[best])
