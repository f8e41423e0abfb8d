"""The stranger: an arm of the same drawing that nobody designed the model for.

It has three links where the drawing has a unit, springs that harden, relax and keep a memory, tendons that rub on
their holes, a rest shape and a mount that are a little off, and motors of their own. Its forces are computed in
`stranger_kernel`, without MuJoCo.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from demo.plants.bench import COMMAND_RATE, Bench, PlantMotion, PrintedArm
from demo.plants.stranger_kernel import Links, LinkState, come_to_rest, path_lengths, simulate
from trunkline.compute.progress import progress
from trunkline.compute.threads import thread_count
from trunkline.frames import STANDARD_GRAVITY
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import unit_properties

UPRIGHT = np.array([0.0, 0.0, -STANDARD_GRAVITY])
CALM = 40.0  # times the joints' own damping, about what brings the arm to rest soonest
STILL = 2e-6  # rad/s: with all joints turning alike the tip then moves by 0.05 mm/s
REST_STEP = 2.5e-4  # s: so damped, the arm bears longer steps than in a trial, and comes to rest in the same place
LONGEST_REST = 12.0  # s

Ratio = Annotated[float, Field(gt=0, le=100)]
Duration = Annotated[float, Field(gt=0, le=1000)]
Bend = Annotated[float, Field(gt=0, le=10)]


@dataclass
class MaxwellBranch:
    """A Maxwell branch beside every joint's spring. ratio: modulus over the relaxed one. time: constant, s."""

    ratio: Ratio
    time: Duration


@dataclass
class Slider:
    """A Jenkins element beside every joint's spring. ratio: stiffness over the joint's relaxed one. bend: of a unit at
    which it slides, rad."""

    ratio: Ratio
    bend: Bend


@dataclass
class StrangerMotors:
    """dead_time: s. rate_limit: m/s of cable. lag: s, of first order. max_force: N. backlash: m, of a winch.
    zero_scatter: m, standard deviation of what a winch reads where its cable is just straight."""

    dead_time: Annotated[float, Field(ge=0, le=10)]
    rate_limit: Annotated[float, Field(gt=0, le=100)]
    lag: Duration
    max_force: Annotated[float, Field(gt=0, le=1e5)]
    backlash: Annotated[float, Field(ge=0, le=1)]
    zero_scatter: Annotated[float, Field(ge=0, le=1)]


@dataclass
class OtherLaws:
    """Laws that the identified model has not, all off by default; of a unit where they are of a joint.

    stiffening: 1/rad², a in K b exp(a b²), which replaces K b where `hardening` is 0. softening: share of the stiffness
    that a large bend takes away, half of it at `softening_bend`, rad. ovality: e, a section is 1 ± e times as stiff
    about its two axes, of which the stiffer is at ovality_deg from x. drag: N, friction of a hole whatever the tension.
    stribeck: relative growth of μ where a cable hardly slides; stribeck_speed: m/s. swirl_deg: by which the last unit's
    holes are turned beside the mount's, evenly along the arm. hole_scatter_deg: standard deviation, per unit.
    """

    stiffening: Annotated[float, Field(ge=0, le=1000)] = 0.0
    softening: Annotated[float, Field(ge=0, lt=1)] = 0.0
    softening_bend: Bend = 0.1
    ovality: Annotated[float, Field(ge=0, lt=1)] = 0.0
    ovality_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    drag: Annotated[float, Field(ge=0, le=10)] = 0.0
    stribeck: Annotated[float, Field(ge=0, le=10)] = 0.0
    stribeck_speed: Annotated[float, Field(gt=0, le=10)] = 0.05
    swirl_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    hole_scatter_deg: Annotated[float, Field(ge=0, le=10)] = 0.0


@dataclass
class StrangerSettings(PrintedArm):
    """The truth about the arm on the bench, which scatters by link. Sources stand in the file.

    links_per_unit: of the drawing. mass_scatter: relative, uniform, per link. viscous_time: s, of the joints' damping,
    D / K. rest_bend: rad, bend of the whole arm about x and y where nothing pulls, evenly; rest_growth: more of it
    towards the tip, less at the base, rad likewise. rest_scatter: rad, standard deviation of a unit's.
    mount_tilt_deg: of the arm against the base marker, to a side that is drawn.
    limit_ratio: stiffness of two links that touch over that of their joint. limit_time: s, its damping over it.
    friction: μ in a hole. slip_length: m of travel within which it builds up. cable_scatter: relative, uniform, of the
    cables' stiffness between winch and mount. substeps: of 1 / COMMAND_RATE s. laws: those that the model has not.
    """

    kind: Literal["stranger"]
    links_per_unit: Annotated[int, Field(ge=1, le=9)]
    mass_scatter: Annotated[float, Field(ge=0, lt=1)]
    viscous_time: Duration
    branches: Annotated[list[MaxwellBranch], Field(max_length=9)]
    sliders: Annotated[list[Slider], Field(max_length=9)]
    rest_bend: tuple[Annotated[float, Field(ge=-3, le=3)], Annotated[float, Field(ge=-3, le=3)]]
    rest_growth: tuple[Annotated[float, Field(ge=-3, le=3)], Annotated[float, Field(ge=-3, le=3)]]
    rest_scatter: Annotated[float, Field(ge=0, le=1)]
    mount_tilt_deg: Annotated[float, Field(ge=0, le=90)]
    limit_ratio: Annotated[float, Field(gt=0, le=1e6)]
    limit_time: Duration
    friction: Annotated[float, Field(ge=0, le=10)]
    slip_length: Annotated[float, Field(gt=0, le=1)]
    cable_scatter: Annotated[float, Field(ge=0, lt=1)]
    motors: StrangerMotors
    substeps: Annotated[int, Field(ge=1, le=100)]
    laws: OtherLaws = field(default_factory=OtherLaws)


class Stranger:
    """The plant; `rng` draws its scatter, and to which side its mount leans."""

    def __init__(
        self, chain: ChainGeometry, settings: StrangerSettings, tendons: int, rng: np.random.Generator
    ) -> None:
        self.settings, self.tendons, self.chain = settings, tendons, chain
        side = rng.uniform(0, 2 * np.pi)
        lean = np.radians(settings.mount_tilt_deg) * np.array([np.cos(side), np.sin(side), 0])
        self.mount = Rotation.from_rotvec(lean)  # base marker ← arm
        self.links = make_links(chain, settings, tendons, rng)
        self.straight = path_lengths(self.links, self._state(np.zeros(tendons)))

    def run(self, label: str, bench: Bench, tracked: list[int]) -> PlantMotion:
        count, rows, _ = bench.commands.shape
        samples = rows // bench.stride - bench.skipped
        positions = np.empty((count, samples, len(tracked), 3))
        rotations, wound = np.empty((*positions.shape, 3)), np.empty((count, samples, self.tendons))
        watched, heights = _centres(self.chain, self.links.lengths)
        gravity = self.mount.inv().apply(bench.gravity)
        before = gravity if bench.hanging else np.tile(self.mount.inv().apply(UPRIGHT), (count, 1))
        begins = [tuple(row) for row in np.column_stack([before, bench.loads, bench.commands[:, 0]])]
        distinct = list(dict.fromkeys(begins))  # of trials that begin alike
        with ThreadPoolExecutor(thread_count()) as pool:
            rests = pool.map(lambda row: self._rest(np.array(row[:3]), row[3], np.array(row[4:])), distinct)
            starts = dict(zip(distinct, rests, strict=True))

        def simulate_trial(index: int) -> None:
            load, sent = bench.loads[index], bench.commands[index]
            state = LinkState(*(part.copy() for part in starts[begins[index]]))
            simulate(
                self.links, state, gravity[index], load, sent, bench.pulls[index], self.straight, COMMAND_RATE,
                self.settings.substeps, round(bench.steady * COMMAND_RATE), bench.steady_factor, bench.stride,
                bench.skipped, watched[tracked], heights[tracked], positions[index], rotations[index], wound[index],
            )  # fmt: skip

        self._all(f"record {label}", simulate_trial, count, "trials")
        assert np.isfinite(positions).all(), "the stranger's engine diverged: its steps are too long"
        turn = self.mount.as_matrix()
        return PlantMotion(positions @ turn.T, turn @ rotations, wound)

    def answers(self) -> dict:
        """Stiffness is the relaxed one of a unit's links in series, at the base, with the mean scatter; damping is what
        acts beside the Maxwell branches. Nothing answers to a tendon's constant friction, as it grows with tension, and
        to a single branch or slider of the model, as there are several. Nor does anything to a parameter of a law that
        the arm has not, or not alone. joint_place is the mean of a unit's links.
        Rest shapes are by unit, c_0 + c_1 s with s from -1 to 1."""
        s, links = self.settings, self.links
        rest = links.rest.reshape(-1, s.links_per_unit, 2).sum(axis=1)
        place = np.linspace(-1, 1, len(rest))
        lean = self.mount.as_rotvec()
        properties = unit_properties(self.chain, s.modulus, s.density, s.core_ratio, damping_ratio=1.0)
        scatter = 1 / (1 / links.stiffness.reshape(-1, s.links_per_unit)).sum(axis=1) / properties.stiffness
        stiffness = scatter.mean() * properties.stiffness[0]
        values = {
            "stiffness": stiffness,
            "hardening": None if s.laws.stiffening or s.laws.softening else s.hardening,
            "joint_place": (s.links_per_unit - 1) / (2 * s.links_per_unit),
            "damping": stiffness * s.viscous_time,
            "tendon_friction": None,
            "friction_time": None,
            "kp": links.cable_stiffness.mean(),
            "kv": s.cable_damping,
            "force_range": s.motors.max_force,
            "time_constant": s.motors.lag,
            "dead_time": s.motors.dead_time,
            "capstan_friction": None if s.laws.stribeck or s.laws.drag else s.friction,
            "rest_bend_x": rest[:, 0].mean(),
            "rest_bend_y": rest[:, 1].mean(),
            "rest_gradient_x": place @ rest[:, 0] / (place @ place),
            "rest_gradient_y": place @ rest[:, 1] / (place @ place),
            "mount_tilt_x": lean[0],
            "mount_tilt_y": lean[1],
            "mount_twist": lean[2],
        }
        return {
            "parameters": values,
            "forces": ["stiffness", "damping", "kp", "kv", "force_range"],
            "mass_factor": s.mass_factor,
            "stiffness_factors": scatter / scatter.mean(),
            "branches": [{"ratio": branch.ratio, "time_s": branch.time} for branch in s.branches],
            "sliders": [{"ratio": slider.ratio, "bend_rad": slider.bend} for slider in s.sliders],
            "rate_limit_m_s": s.motors.rate_limit,
            "backlash_m": s.motors.backlash,
            "zero_m": links.zero,
            "rest_bend_rad": rest,
        }

    def _state(self, wound: np.ndarray) -> LinkState:
        """Straight, nothing bears, the motors at `wound` (K,) m."""
        links, units = len(self.links.lengths), len(self.links.hole_link)
        s = self.settings
        return LinkState(
            q=np.zeros((links, 2)), v=np.zeros((links, 2)), branches=np.zeros((len(s.branches), links, 2)),
            sliders=np.zeros((len(s.sliders), links, 2)), slips=np.zeros((self.tendons, units + 1)),
            motors=np.array(wound, float), winches=np.array(wound, float),
        )  # fmt: skip

    def _rest(self, gravity: np.ndarray, load: float, sent: np.ndarray) -> LinkState:
        """The arm long after it was left alone, straight, with the motors at `sent` (K,) m."""
        state = self._state(sent)
        steps = round(LONGEST_REST / REST_STEP)
        come_to_rest(self.links, state, gravity, load, sent, self.straight, REST_STEP, steps, CALM, STILL)
        state.v[:] = 0.0
        return state

    def _all(self, label: str, task: Callable[[int], None], count: int, unit: str) -> None:
        with ThreadPoolExecutor(thread_count()) as pool, progress(count, label, unit) as bar:
            for done in as_completed([pool.submit(task, index) for index in range(count)]):
                done.result()
                bar.update(1)


def make_links(chain: ChainGeometry, settings: StrangerSettings, tendons: int, rng: np.random.Generator) -> Links:
    """The stranger's links: the drawing's spiral cut `links_per_unit` times as fine, with the scatter of `rng`."""
    s, per = settings, settings.links_per_unit
    fine = finer(chain, per)
    properties = unit_properties(fine, s.modulus, s.density, s.core_ratio, damping_ratio=1.0)
    count, place = fine.units, (np.arange(fine.units) + 0.5) / fine.units
    masses = s.mass_factor * (1 + s.mass_scatter * rng.uniform(-1, 1, count))
    stiffness = properties.stiffness * (1 + s.stiffness_scatter * rng.uniform(-1, 1, count))
    rest = np.outer(np.ones(count), s.rest_bend) + np.outer(2 * place - 1, s.rest_growth)
    rest = rest / count + s.rest_scatter / np.sqrt(per) * rng.normal(size=(count, 2))
    cables = s.cable_stiffness * (1 + s.cable_scatter * rng.uniform(-1, 1, tendons))
    zero = s.motors.zero_scatter * rng.normal(size=tendons)
    hole_link, hole_height = _centres(chain, fine.lengths)
    laws, axis = s.laws, 2 * np.radians(s.laws.ovality_deg)
    swirl = np.radians(laws.swirl_deg * np.arange(1, chain.units + 1) / chain.units)
    if laws.hole_scatter_deg:
        swirl = swirl + np.radians(laws.hole_scatter_deg) * rng.normal(size=chain.units)
    return Links(
        lengths=fine.lengths, masses=masses * properties.masses, transverse=masses * properties.transverse_inertia,
        axial=masses * properties.axial_inertia, stiffness=stiffness, hardening=s.hardening * per**2,
        stiffening=laws.stiffening * per**2, softening=laws.softening, softening_bend=laws.softening_bend / per,
        ovality=laws.ovality * np.array([np.cos(axis), np.sin(axis)]), rest=rest,
        viscous_time=s.viscous_time, branch_ratio=np.array([b.ratio for b in s.branches]),
        branch_time=np.array([b.time for b in s.branches]), slider_ratio=np.array([e.ratio for e in s.sliders]),
        slider_yield=np.array([e.bend / per for e in s.sliders]), limit=float(fine.joint_range[0]),
        limit_ratio=s.limit_ratio, limit_time=s.limit_time, hole_link=hole_link, hole_height=hole_height,
        hole_radius=s.hole_ratio * chain.widths / 2, base_radius=s.hole_ratio * float(chain.widths[0]) / 2,
        azimuth=2 * np.pi * np.arange(tendons) / tendons, swirl=swirl, friction=s.friction, slip_length=s.slip_length,
        drag=laws.drag, stribeck=laws.stribeck, stribeck_speed=laws.stribeck_speed,
        cable_stiffness=cables, cable_damping=s.cable_damping, zero=zero, dead_time=s.motors.dead_time,
        rate_limit=s.motors.rate_limit, lag=s.motors.lag, max_force=s.motors.max_force, backlash=s.motors.backlash,
    )  # fmt: skip


def finer(chain: ChainGeometry, per: int) -> ChainGeometry:
    """The same arm with each unit cut into `per` similar ones."""
    ratio = chain.ratio ** (1 / per)
    within = ratio ** np.arange(per)
    return ChainGeometry(
        lengths=np.outer(chain.lengths, within / within.sum()).ravel(),
        widths=np.outer(chain.widths, within).ravel(),
        joint_range=np.repeat(chain.joint_range / per, per),
        ratio=ratio,
    )


def _centres(chain: ChainGeometry, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The link in which each unit's centre lies, and its height above that link's joint (negative), m."""
    ends = np.cumsum(lengths)
    centres = np.cumsum(chain.lengths) - chain.lengths / 2
    links = np.searchsorted(ends, centres)
    return links, ends[links] - lengths[links] - centres
