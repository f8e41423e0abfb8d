"""What a model's tendons and hinges are: the arm's own, or parts of its joints, by their names.

`trunkline/arm/joints.py` builds those parts: Maxwell branches, named `<hinge>_branch_<number>`, and Jenkins elements,
`<hinge>_slider_<number>`. `trunkline/arm/holes.py` gives a cable tendons by which it rubs on its holes, named
`<cable>_hole_<number>`, and the model a number `capstan_friction`, their coefficient.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

BRANCH, SLIDER, HOLE = "branch", "slider", "hole"
CAPSTAN_FRICTION = "capstan_friction"


@dataclass(frozen=True)
class Elements:
    """Those of one kind and number in a model, one for each of n hinges of the arm.

    tendon, hinge: numbers of their tendons and of the arm's hinges. own: of a branch's own hinges. Shape (n,).
    """

    tendon: np.ndarray
    hinge: np.ndarray
    own: np.ndarray


def elements(model: mujoco.MjModel, kind: str, number: int = 1) -> Elements:
    """The model's elements `kind`, BRANCH or SLIDER, of this number; none where it was built without."""
    ending = f"_{kind}_{number}"
    tendons = [t for t in range(model.ntendon) if model.tendon(t).name.endswith(ending)]
    names = [model.tendon(t).name for t in tendons]
    hinges = [model.joint(name.removesuffix(ending)).id for name in names]
    own = [model.joint(name).id for name in names] if kind == BRANCH else []
    return Elements(*(np.array(found, dtype=int) for found in (tendons, hinges, own)))


def all_elements(model: mujoco.MjModel, kind: str) -> list[Elements]:
    """Those of every number that the model has, in order."""
    found = []
    while len((one := elements(model, kind, len(found) + 1)).tendon):
        found.append(one)
    return found


def arm_hinges(model: mujoco.MjModel) -> int:
    """How many hinges are the arm's; they come first, branches after them."""
    return model.njnt - sum(len(branch.own) for branch in all_elements(model, BRANCH))


def cables(model: mujoco.MjModel) -> list[int]:
    """Numbers of the tendons that run along the arm; the others are parts of joints, or rub."""
    along = [t for t in range(model.ntendon) if model.wrap_type[model.tendon_adr[t]] != mujoco.mjtWrap.mjWRAP_JOINT]
    return [t for t in along if f"_{HOLE}_" not in model.tendon(t).name]


def holes(model: mujoco.MjModel) -> np.ndarray:
    """Numbers of the tendons by which each cable rubs, P for each. Shape (K, P), P = 0 where nothing rubs."""
    tendons = [t for t in range(model.ntendon) if f"_{HOLE}_" in model.tendon(t).name]
    return np.array(tendons, dtype=int).reshape(len(cables(model)), -1) if tendons else np.zeros((0, 0), dtype=int)


def capstan_friction(model: mujoco.MjModel) -> float:
    """The coefficient μ with which its cables rub, 0 where nothing rubs."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, CAPSTAN_FRICTION)
    return float(model.numeric_data[model.numeric_adr[number]]) if number >= 0 else 0.0


def let_slide(model: mujoco.MjModel) -> None:
    """Take the friction of cables on their holes from a model, in place."""
    if capstan_friction(model):
        model.numeric_data[model.numeric_adr[model.numeric(CAPSTAN_FRICTION).id]] = 0
