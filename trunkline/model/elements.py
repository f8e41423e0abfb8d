"""What a model's tendons, hinges and sites are, by their names: the arm's own, or parts of its joints.

`trunkline/model/arm/joints.py` builds those parts: Maxwell branches, hinges named `<hinge>_branch_<number>` and the
tendons that tie them, which end in `_tie`, Jenkins elements, tendons named `<hinge>_slider_<number>`, and the
diagonals of a round joint, tendons named `<hinge>_diagonal_<number>` after its first hinge.
`trunkline/model/arm/guide_holes.py` gives a cable tendons by which it rubs on its holes, named `<cable>_hole_<number>`,
and the model a number `capstan_friction`, their coefficient, and `slip_length`, m of sliding within which it builds up.
Numbers `rate_limit` and `backlash` are those of the motors' winches (`trunkline/model/simulation/winch.py`); 0 stands
for none. `winding` and `preload` say what a logged command draws in: so many times its metres, and so many metres of
each cable beyond the straight arm's where it is 0. `sections` are the numbers of units of an arm that is made of
several.
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import mujoco
import numpy as np

BRANCH, SLIDER, DIAGONAL, HOLE = "branch", "slider", "diagonal", "hole"
TIE = "_tie"  # ends the name of a branch's tendon: in a Unity scene it may not be called as the hinge
CAPSTAN_FRICTION, SLIP_LENGTH = "capstan_friction", "slip_length"
SLIP = 2e-4  # m, of models that do not say: see conf/build_mjcf/holes/rubbing.yaml
HINGE_SHARE, DIAGONAL_SHARE = 2 / 3, 1 / 6  # of the hardening K c of a round joint, see `trunkline/model/arm/joints.py`
RATE_LIMIT, BACKLASH = "rate_limit", "backlash"  # of winches, m/s and m of cable
WINDING, PRELOAD, SECTIONS = "winding", "preload", "sections"


@dataclass(frozen=True)
class Elements:
    """Those of one kind and number in a model, one for each of n hinges of the arm.

    tendon, hinge: numbers of their tendons and of the hinges of the arm. branch: hinges of Maxwell elements, empty
    for other kinds. Shape (n,).
    """

    tendon: np.ndarray
    hinge: np.ndarray
    branch: np.ndarray


# by model: those that were looked for; names are fixed once a model is compiled, and looking through them takes long
_CACHE: WeakKeyDictionary[mujoco.MjModel, dict[tuple[str, int], Elements]] = WeakKeyDictionary()


def elements(model: mujoco.MjModel, kind: str, number: int = 1) -> Elements:
    """The model's elements `kind`, BRANCH, SLIDER or DIAGONAL, of this number; none where it was built without."""
    cached = _CACHE.setdefault(model, {})
    if (kind, number) not in cached:
        cached[kind, number] = _named(model, kind, number)
    return cached[kind, number]


def _named(model: mujoco.MjModel, kind: str, number: int) -> Elements:
    ending = f"_{kind}_{number}"
    names = {tendon: model.tendon(tendon).name.removesuffix(TIE) for tendon in range(model.ntendon)}
    names = {tendon: name for tendon, name in names.items() if name.endswith(ending)}
    hinges = [model.joint(name.removesuffix(ending)).id for name in names.values()]
    own_hinges = [model.joint(name).id for name in names.values()] if kind == BRANCH else []
    return Elements(*(np.array(numbers, dtype=int) for numbers in (list(names), hinges, own_hinges)))


def all_elements(model: mujoco.MjModel, kind: str) -> list[Elements]:
    """Those of every number that the model has, in order."""
    result = []
    while len((group := elements(model, kind, len(result) + 1)).tendon):
        result.append(group)
    return result


def diagonal_lengths(model: mujoco.MjModel, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the tendons that are diagonals of round joints (D,), and how long they are, rad, at joint angles
    (..., nq): the sum of the joint's two, and their difference. Shape (..., D)."""
    tendons, lengths = [np.zeros(0, dtype=int)], [np.zeros((*angles.shape[:-1], 0))]
    for diagonals, sign in zip(all_elements(model, DIAGONAL), (1, -1), strict=False):
        tendons.append(diagonals.tendon)
        lengths.append(angles[..., diagonals.hinge] + sign * angles[..., diagonals.hinge + 1])
    return np.concatenate(tendons), np.concatenate(lengths, axis=-1)


def unload_branches(model: mujoco.MjModel, qpos: np.ndarray) -> None:
    """Put the joints' branches where they bear nothing, in place: those of an arm that was long in the pose `qpos`.

    Args:
        qpos: angles of all hinges, rad; those of the arm are read, those of branches written. Shape (..., nq).
    """
    for branches in all_elements(model, BRANCH):
        qpos[..., branches.branch] = qpos[..., branches.hinge]


def arm_hinges(model: mujoco.MjModel) -> int:
    """How many hinges are the arm's; they come first, branches after them."""
    return model.njnt - sum(len(group.branch) for group in all_elements(model, BRANCH))


def marker_sites(model: mujoco.MjModel, markers: tuple[str, ...]) -> np.ndarray:
    """Numbers of the sites that are the frames of `markers`, in their order. Shape (S,)."""
    return np.array([model.site(f"{name}_center").id for name in markers], dtype=int)


def cables(model: mujoco.MjModel) -> list[int]:
    """Numbers of the tendons that run along the arm; the others are parts of joints, or rub."""
    return [t for t in range(model.ntendon) if model.wrap_type[model.tendon_adr[t]] != mujoco.mjtWrap.mjWRAP_JOINT]


def hole_name(cable: str, number: int) -> str:
    """Of the tendon by which a cable rubs in a stretch of the arm, counted from 1."""
    return f"{cable}_{HOLE}_{number}"


def hole_tendons(model: mujoco.MjModel) -> np.ndarray:
    """Numbers of the tendons by which each cable rubs, P for each. Shape (K, P), P = 0 where nothing rubs."""
    tendons = [t for t in range(model.ntendon) if is_hole(model.tendon(t).name)]
    return np.array(tendons, dtype=int).reshape(len(cables(model)), -1) if tendons else np.zeros((0, 0), dtype=int)


def is_hole(tendon: str) -> bool:
    """Whether a tendon of this name is one by which a cable rubs."""
    return f"_{HOLE}_" in tendon


def stretch_edges(units: int, stretches: int) -> np.ndarray:
    """At which units the stretches of an arm begin in which a cable rubs, and where the last one ends. Shape (P + 1,).

    There are at most as many as units.
    """
    count = min(stretches, units)
    return np.arange(count + 1) * units // count


def actuators(model: mujoco.MjModel) -> np.ndarray:
    """Number of the actuator that draws each cable in, in the order of the cables. Shape (K,)."""
    on_tendons = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON  # a joint's motor has the joint's number there
    drawn = np.where(on_tendons, model.actuator_trnid[:, 0], -1)
    return np.array([np.flatnonzero(drawn == cable)[0] for cable in cables(model)], dtype=int)


def numeric_place(model: mujoco.MjModel, name: str) -> int | None:
    """Where among the model's `numeric_data` the number of this name is; None if it has none."""
    places = numbers_place(model, name)
    return int(places[0]) if len(places) else None


def numeric(model: mujoco.MjModel, name: str) -> float:
    """The model's number of this name, 0 if it has none."""
    place = numeric_place(model, name)
    return 0.0 if place is None else float(model.numeric_data[place])


def numbers_place(model: mujoco.MjModel, name: str) -> np.ndarray:
    """Where among the model's `numeric_data` the numbers of this name are, none if it has none. Shape (k,)."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    if number < 0:
        return np.zeros(0, dtype=int)
    return model.numeric_adr[number] + np.arange(model.numeric_size[number])


def capstan_friction(model: mujoco.MjModel) -> float:
    """The coefficient μ with which its cables rub, 0 where nothing rubs."""
    return numeric(model, CAPSTAN_FRICTION)


def slip_length(model: mujoco.MjModel) -> float:
    """m of sliding within which the friction of its cables builds up."""
    return SLIP if numeric_place(model, SLIP_LENGTH) is None else numeric(model, SLIP_LENGTH)


def switch_off(model: mujoco.MjModel, *names: str) -> None:
    """Set the model's numbers of these names to 0, in place."""
    for name in names:
        place = numeric_place(model, name)
        if place is not None:
            model.numeric_data[place] = 0


def switch_off_capstan_friction(model: mujoco.MjModel) -> None:
    """Take the friction of cables on their holes from a model, in place."""
    switch_off(model, CAPSTAN_FRICTION)


def switch_off_cables(model: mujoco.MjModel) -> None:
    """Take all cables from a model in place, for where they are slack and so move nothing: each is cut down to a
    point, as its path takes much of a step."""
    switch_off_capstan_friction(model)
    model.tendon_num[cables(model)] = 1
