"""Trials that a lab could record: a grid over kinds, sides, levels and loads."""

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np

from trunkline.frames import STANDARD_GRAVITY
from trunkline.identification.simulate.experiment import SLACK
from trunkline.kinematics.dataset.sampling import around_the_arm
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import read_chain
from trunkline.tools.suggest.settings import Recordable

UPRIGHT = np.array([0.0, 0.0, -STANDARD_GRAVITY])
CURL_ENDS = (0.1, 0.7, 1.2, 1.8)  # s, of the ramp to the pull and of that back


@dataclass(frozen=True)
class Candidate:
    """A trial that could be recorded.

    name: of its log. kind: of experiment. how: what is done, in words. level, load: as session.yaml has them.
    gravity: m/s², base frame. Shape (3,). turn: rad, by which the arm is held bent, evenly along it, at first.
    side: rad, towards which. pulls: m of each motor's tendon, less than 0 where it is let out, one row a frame of a
    moving trial. Shape (T, nu). minutes: that it takes.
    """

    name: str
    kind: str
    how: str
    minutes: float
    pulls: np.ndarray
    gravity: np.ndarray
    level: float | None = None
    load: float = 0.0
    turn: float = 0.0
    side: float = 0.0


def candidates(grid: Recordable, model: mujoco.MjModel, kinds: tuple[str, ...], frames: int) -> list[Candidate]:
    """All that `grid` says an arm could do, of the kinds of experiment `kinds`.

    Args:
        frames: of a moving trial that are looked at.
    """
    masses = [round(share * float(model.body_subtreemass[model.jnt_bodyid[0]]), 3) for share in grid.loads]
    loads = [0.0, *dict.fromkeys(mass for mass in masses if mass > 0)]
    slack, offered = np.full(model.nu, -SLACK), []
    if "static_tilt" in kinds:
        offered += [_tilt(0.0, 0.0, load, grid, slack) for load in loads]
        sides = _sides(grid.tilt_sides)
        offered += [_tilt(*values, grid, slack) for values in product(grid.tilts_deg, sides, loads)]
    if "release" in kinds:
        sides = _sides(grid.release_sides)
        bends = product(grid.release_turns_deg, sides, loads)
        offered += [_release(*values, grid, np.tile(slack, (frames, 1))) for values in bends]
    if model.nu:
        offered += _motored(grid, model, kinds, frames)
    return offered


def _sides(count: int) -> list[float]:
    return [360.0 * k / count for k in range(count)]


def _tilt(tilt: float, side: float, load: float, grid: Recordable, slack: np.ndarray) -> Candidate:
    way, across = np.radians(side), np.sin(np.radians(tilt))
    gravity = STANDARD_GRAVITY * np.array([across * np.cos(way), across * np.sin(way), -np.cos(np.radians(tilt))])
    how = f"tilt the mount by {tilt:.0f}°, so that gravity pulls the arm towards {side:.0f}°"
    how = how if tilt else "let the arm hang, its mount upright"
    name = f"tilt_{tilt:03.0f}_side_{side:03.0f}" if tilt else "tilt_000"
    return Candidate(
        name + _grams(load), "static_tilt", how + _loaded(load), grid.minutes.of("static_tilt", load),
        slack[None], gravity, level=tilt, load=load,
    )  # fmt: skip


def _release(turn: float, side: float, load: float, grid: Recordable, slack: np.ndarray) -> Candidate:
    how = f"bend the arm by {turn:.0f}° in all towards {side:.0f}°, hold it still, let go{_loaded(load)}"
    return Candidate(
        f"release_{turn:03.0f}_side_{side:03.0f}{_grams(load)}", "release", how, grid.minutes.of("release", load),
        slack, UPRIGHT, load=load, turn=float(np.radians(turn)), side=float(np.radians(side)),
    )  # fmt: skip


def _motored(grid: Recordable, model: mujoco.MjModel, kinds: tuple[str, ...], frames: int) -> list[Candidate]:
    """Pulls and curls of one tendon and of two neighbours, and motions to all sides."""
    chain = read_chain(model)
    order = ArmModel(model).actuators[around_the_arm(chain)]  # motors, as their tendons lie around the arm
    names = [model.tendon(model.actuator_trnid[motor, 0]).name for motor in range(model.nu)]
    length = float(np.linalg.norm(chain.offset, axis=1).sum() + np.linalg.norm(chain.tip))
    groups = [(motor,) for motor in order]
    groups += [(a, b) for a, b in zip(order, np.roll(order, -1), strict=True)] if model.nu > 2 else []
    time, offered = np.arange(frames) / grid.frame_rate, []
    for kind, shares in (("static_pull", grid.pulls), ("curl", grid.curls)):
        profile = np.interp(time, CURL_ENDS, [0, 1, 1, 0]) if kind == "curl" else np.ones(1)
        for group, share in product(groups if kind in kinds else [], shares):
            level = round(1e3 * share * length)
            pulls = np.full((len(profile), model.nu), -SLACK)
            pulls[:, list(group)] = profile[:, None] * level / 1e3
            offered.append(_pull(kind, [names[motor] for motor in group], level, pulls, grid))
    if "motion" in kinds:
        offered += [_motion(index, grid, model, length, time) for index in range(len(grid.motions))]
    return offered


def _pull(kind: str, tendons: list[str], level: int, pulls: np.ndarray, grid: Recordable) -> Candidate:
    """Slowly and at rest, or a curl. level: mm."""
    words = f"pull {' and '.join(tendons)} by {level} mm{'' if len(tendons) == 1 else ' each'}"
    slow = ", slowly, the others let out, and wait until the arm rests"
    how = words + (slow if kind == "static_pull" else " within 0.6 s, hold, and let out again; the others are let out")
    who = "_".join(tendon.removeprefix("tendon_") for tendon in tendons)
    name = f"{kind.removeprefix('static_')}_{who}_{level:03d}"
    return Candidate(
        name, kind, how, grid.minutes.of(kind, 0), pulls, UPRIGHT, level=level if kind == "curl" else None
    )


def _motion(index: int, grid: Recordable, model: mujoco.MjModel, length: float, time: np.ndarray) -> Candidate:
    """Sines to x and y, each with a phase of its own, as `Sines` has them."""
    sines = grid.motions[index]
    holes = model.site_pos[model.wrap_objid[model.tendon_adr[model.actuator_trnid[:, 0]]]]
    azimuths = np.arctan2(holes[:, 1], holes[:, 0])
    phases = np.random.default_rng(index).uniform(0, 2 * np.pi, (len(sines.frequencies), 2))
    turns = 2 * np.pi * np.outer(time, sines.frequencies)
    sides = np.sin(turns[:, :, None] + phases).sum(axis=1) - np.sin(phases).sum(axis=0)
    sides *= sines.amplitude * length / np.abs(np.sin(2 * np.pi * np.linspace(0, 60, 6000)[:, None, None]
             * np.array(sines.frequencies)[:, None] + phases).sum(axis=1)).max(axis=0)  # fmt: skip
    pulls = sides @ np.stack([np.cos(azimuths), np.sin(azimuths)]) + sines.offset * length
    rates = ", ".join(f"{rate:g}" for rate in sines.frequencies)
    how = (f"drive all tendons by sines of {rates} Hz to both sides, up to {1e3 * sines.amplitude * length:.0f} mm "
           f"about {1e3 * sines.offset * length:.0f} mm")  # fmt: skip
    name = f"motion_{10 * max(sines.frequencies):.0f}_{1e3 * sines.amplitude * length:.0f}"
    return Candidate(name, "motion", how, grid.minutes.of("motion", 0), pulls, UPRIGHT)


def _grams(load: float) -> str:
    return f"_{1000 * load:.0f}g" if load else ""


def _loaded(load: float) -> str:
    return f", with {1000 * load:.0f} g at the tip" if load else ""
