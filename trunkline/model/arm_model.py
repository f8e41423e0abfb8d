"""A compiled arm's parts by what they are: MuJoCo has joints, tendons and numbers, and an arm more than that.

`trunkline/model/arm/joints.py` builds parts of joints: Maxwell branches, hinges named `<hinge>_branch_<number>` and the
tendons that tie them, which end in `_tie`, Jenkins elements, tendons named `<hinge>_slider_<number>`, and the
diagonals of a round joint, tendons named `<hinge>_diagonal_<number>` after its first hinge.
`trunkline/model/arm/guide_holes.py` gives a cable tendons by which it rubs on its holes, named `<cable>_hole_<number>`,
and the model a number `capstan_friction`, their coefficient, and `slip_length`, m of sliding within which it builds up.
Numbers `rate_limit` and `backlash` are those of the motors' winches (`trunkline/model/simulation/winch.py`); 0 stands
for none. `winding` and `preload` say what a logged command draws in: so many times its metres, and so many metres of
each cable beyond the straight arm's where it is 0; of motors that are commanded by force, `force_scale` says how many
times its newtons it pulls with. `sections` are the numbers of units of an arm that is made of
several. `axial_stiffness` is EA of each unit, N, of an arm that gets shorter under its tendons
(`trunkline/model/simulation/shortening.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal
from weakref import WeakKeyDictionary

import mujoco
import numpy as np

from trunkline.errors import InputError

BRANCH, SLIDER, DIAGONAL, HOLE = "branch", "slider", "diagonal", "hole"
CENTER = "_center"  # ends the name of a marker's site
TIE = "_tie"  # ends the name of a branch's tendon: in a Unity scene it may not be called as the hinge
CAPSTAN_FRICTION, SLIP_LENGTH = "capstan_friction", "slip_length"
SLIP = 2e-4  # m, of models that do not say: see conf/build_mjcf/holes/rubbing.yaml
HINGE_SHARE, DIAGONAL_SHARE = 2 / 3, 1 / 6  # of the hardening K c of a round joint, see `trunkline/model/arm/joints.py`
RATE_LIMIT, BACKLASH = "rate_limit", "backlash"  # of winches, m/s and m of cable
WINDING, PRELOAD, SECTIONS = "winding", "preload", "sections"
FORCE_SCALE, AXIAL_STIFFNESS = "force_scale", "axial_stiffness"
TIP_LOAD = "tip_load"  # the body that an arm's description hangs at the tip

# by model, for all its `ArmModel`s: names are fixed once a model is compiled, and looking through them takes long
_CACHED: WeakKeyDictionary[mujoco.MjModel, dict] = WeakKeyDictionary()


@dataclass(frozen=True)
class Elements:
    """Those of one kind and number in a model, one for each of n hinges of the arm.

    tendon, hinge: numbers of their tendons and of the hinges of the arm. branch: hinges of Maxwell elements, empty
    for other kinds. Shape (n,).
    """

    tendon: np.ndarray
    hinge: np.ndarray
    branch: np.ndarray


class ArmModel:
    """A tendon-driven arm as MuJoCo has it, with what MuJoCo has no names for.

    Where things are is looked up once for each MjModel; values are read from it when they are asked for, as many change
    during identification.
    """

    __slots__ = ("__dict__", "model")

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.__dict__ = _CACHED.setdefault(model, {})  # of the cached properties; `model` is a slot beside it

    @cached_property
    def elements(self) -> dict[str, list[Elements]]:
        """Parts of joints by kind, BRANCH, SLIDER or DIAGONAL, and number."""
        return {kind: self._elements(kind) for kind in (BRANCH, SLIDER, DIAGONAL)}

    @property
    def branches(self) -> list[Elements]:
        """Maxwell branches."""
        return self.elements[BRANCH]

    @property
    def sliders(self) -> list[Elements]:
        """Jenkins elements."""
        return self.elements[SLIDER]

    @property
    def diagonals(self) -> list[Elements]:
        """Of round joints: tendons as long as the sum of a joint's two angles, and as their difference."""
        return self.elements[DIAGONAL]

    def _elements(self, kind: str) -> list[Elements]:
        names = {self.model.tendon(tendon).name.removesuffix(TIE): tendon for tendon in range(self.model.ntendon)}
        groups = []
        while group := [name for name in names if name.endswith(f"_{kind}_{len(groups) + 1}")]:
            hinges = [self.model.joint(name.removesuffix(f"_{kind}_{len(groups) + 1}")).id for name in group]
            branches = [self.model.joint(name).id for name in group] if kind == BRANCH else []
            numbers = ([names[name] for name in group], hinges, branches)
            groups.append(Elements(*(np.array(each, dtype=int) for each in numbers)))
        return groups

    @cached_property
    def hinge_count(self) -> int:
        """How many hinges are the arm's; they come first, branches after them."""
        return self.model.njnt - sum(len(group.branch) for group in self.branches)

    @cached_property
    def unit_bodies(self) -> np.ndarray:
        """Bodies that the arm's hinges move, base first. Bodies without joints belong to the unit that they are welded
        to. Shape (units,)."""
        return np.unique(self.model.jnt_bodyid[: self.hinge_count])

    @cached_property
    def unit_of_hinge(self) -> np.ndarray:
        """For each hinge of the arm the number, from 0, of the unit that it moves. Shape (n,)."""
        return np.searchsorted(self.unit_bodies, self.model.jnt_bodyid[: self.hinge_count])

    @cached_property
    def own_bodies(self) -> np.ndarray:
        """Bodies whose masses are the arm's: its units and what is welded to them, but for the load at the tip. Shape
        (n,)."""
        moved = np.flatnonzero(np.isin(self.model.body_weldid, self.unit_bodies))
        return moved[moved != mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, TIP_LOAD)]

    @cached_property
    def cables(self) -> np.ndarray:
        """Numbers of the K tendons that run along the arm; the others are parts of joints, or rub. Shape (K,)."""
        return np.flatnonzero(self.model.wrap_type[self.model.tendon_adr] != mujoco.mjtWrap.mjWRAP_JOINT)

    @cached_property
    def cable_names(self) -> list[str]:
        return [self.model.tendon(cable).name for cable in self.cables]

    @cached_property
    def actuators(self) -> np.ndarray:
        """Number of the actuator that draws each cable in, in the order of the cables; statics refuse a cable that none
        draws in, and it has none here. Shape (K,)."""
        on_tendons = self.model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON  # a joint's motor has the joint there
        drawn = np.where(on_tendons, self.model.actuator_trnid[:, 0], -1)
        return np.array([np.flatnonzero(drawn == cable)[0] for cable in self.cables if cable in drawn], dtype=int)

    @cached_property
    def commands(self) -> Literal["length", "force"]:
        """What its actuators are sent: lengths of cable that they hold, m, or tensions, N."""
        motors = self.actuators
        forced = self.model.actuator_biastype[motors] == mujoco.mjtBias.mjBIAS_NONE
        return "force" if len(motors) and forced.all() else "length"

    @property
    def command_unit(self) -> str:
        """m or N."""
        return "N" if self.commands == "force" else "m"

    def controls(self, pulls: np.ndarray) -> np.ndarray:
        """What actuators are sent for pulls of theirs, m from the straight arm or N. Both of shape (..., nu)."""
        if self.commands == "force":
            return np.array(pulls, dtype=float)
        return self.model.tendon_length0[self.model.actuator_trnid[:, 0]] - pulls

    def require_lengths(self, what: str) -> None:
        """Raise InputError, one line that begins with `what`, for an arm whose motors are commanded by force."""
        if self.commands == "force":
            raise InputError(f"{what}: found an arm whose motors are commanded by force, N, expected lengths of cable: "
                             "build_mjcf.actuation.commands: length, or stages up to `score` and `fk_dataset` alone"
                             )  # fmt: skip

    def require_stiff_units(self, what: str) -> None:
        """Raise InputError, one line that begins with `what`, for an arm that gets shorter under its tendons."""
        if len(self.axial_stiffness):
            raise InputError(f"{what}: found an arm with axial_stiffness, expected one without: its shortening is "
                             "known at rest alone, in identify_stiffness and score")  # fmt: skip

    @cached_property
    def guide_holes(self) -> np.ndarray:
        """Numbers of the tendons by which each cable rubs, P for each. Shape (K, P), P = 0 where nothing rubs."""
        tendons = [t for t in range(self.model.ntendon) if f"_{HOLE}_" in self.model.tendon(t).name]
        return np.array(tendons, dtype=int).reshape(len(self.cables), -1) if tendons else np.zeros((0, 0), dtype=int)

    @cached_property
    def tip_site(self) -> int:
        return self.model.site("tip").id

    @cached_property
    def base_body(self) -> int:
        """The mount."""
        return self.model.body("base").id

    @cached_property
    def markers(self) -> list[str]:
        """Names of the markers that may be tracked, in the order of their sites."""
        names = [self.model.site(site).name for site in range(self.model.nsite)]
        return [name.removesuffix(CENTER) for name in names if name.endswith(CENTER) and name != f"base{CENTER}"]

    def marker_sites(self, markers: Sequence[str]) -> np.ndarray:
        """Numbers of the sites that are the frames of `markers`, in their order. Shape (S,)."""
        return np.array([self.model.site(f"{name}{CENTER}").id for name in markers], dtype=int)

    def cable_sites(self, cable: int) -> np.ndarray:
        """Numbers of the sites through which the tendon `cable` runs, that of the mount first."""
        first = self.model.tendon_adr[cable]
        return self.model.wrap_objid[first : first + self.model.tendon_num[cable]]

    def diagonal_lengths(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the tendons that are diagonals of round joints (D,), and how long they are, rad, at joint angles
        (..., nq): the sum of the joint's two, and their difference. Shape (..., D)."""
        tendons, lengths = [np.zeros(0, dtype=int)], [np.zeros((*angles.shape[:-1], 0))]
        for diagonals, sign in zip(self.diagonals, (1, -1), strict=False):
            tendons.append(diagonals.tendon)
            lengths.append(angles[..., diagonals.hinge] + sign * angles[..., diagonals.hinge + 1])
        return np.concatenate(tendons), np.concatenate(lengths, axis=-1)

    def unload_branches(self, qpos: np.ndarray) -> None:
        """Put the joints' branches where they bear nothing, in place: those of an arm that was long in the pose `qpos`.

        Args:
            qpos: angles of all hinges, rad; those of the arm are read, those of branches written. Shape (..., nq).
        """
        for branches in self.branches:
            qpos[..., branches.branch] = qpos[..., branches.hinge]

    def places(self, name: str) -> np.ndarray:
        """Where among the model's `numeric_data` the numbers of this name are, none if it has none. Shape (k,)."""
        number = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
        if number < 0:
            return np.zeros(0, dtype=int)
        return self.model.numeric_adr[number] + np.arange(self.model.numeric_size[number])

    def numbers(self, name: str) -> np.ndarray:
        """The model's numbers of this name, none if it has none. Shape (k,)."""
        return self.model.numeric_data[self.places(name)]

    def number(self, name: str, default: float = 0.0) -> float:
        """The model's number of this name, or the default if it has none."""
        values = self.numbers(name)
        return float(values[0]) if len(values) else default

    @property
    def capstan_friction(self) -> float:
        """The coefficient μ with which its cables rub, 0 where nothing rubs."""
        return self.number(CAPSTAN_FRICTION)

    @property
    def rubs(self) -> bool:
        """Whether its cables rub while it moves: statics know the friction of a model without the tendons for it."""
        return self.guide_holes.size > 0 and self.capstan_friction > 0

    @property
    def slip_length(self) -> float:
        """m of sliding within which the friction of its cables builds up."""
        return self.number(SLIP_LENGTH, SLIP)

    @property
    def rate_limit(self) -> float:
        """Of its winches, m/s of cable, 0 for none."""
        return self.number(RATE_LIMIT)

    @property
    def backlash(self) -> float:
        """Of its winches, m of cable, 0 for none."""
        return self.number(BACKLASH)

    @property
    def preload(self) -> np.ndarray:
        """m by which each cable is drawn in where its command is 0. Shape (K,), or empty."""
        return self.numbers(PRELOAD)

    @property
    def sections(self) -> np.ndarray:
        """Numbers of units of an arm that is made of several sections, else empty."""
        return self.numbers(SECTIONS).astype(int)

    @property
    def axial_stiffness(self) -> np.ndarray:
        """EA of each unit, N. Shape (n,), or empty of units that keep their lengths."""
        return self.numbers(AXIAL_STIFFNESS)

    def switch_off(self, *names: str) -> bool:
        """Set the model's numbers of these names to 0, in place; returns whether any was on, by its first value."""
        changed = any(self.number(name) for name in names)
        for name in names:
            self.model.numeric_data[self.places(name)] = 0
        return changed

    def switch_off_cables(self) -> None:
        """Take all cables from the model in place, for where they are slack and so move nothing: each is cut down to a
        point, as its path takes much of a step."""
        self.switch_off(CAPSTAN_FRICTION)
        self.model.tendon_num[self.cables] = 1


def stretch_edges(units: int, stretches: int) -> np.ndarray:
    """At which units the stretches of an arm begin in which a cable rubs, and where the last one ends. Shape (P + 1,).

    There are at most as many as units.
    """
    count = min(stretches, units)
    return np.arange(count + 1) * units // count
