"""`python -m studies.warp`: how far MuJoCo Warp, which simulates in 32-bit floats on a GPU, is from MuJoCo.

The pipeline's CAD arm is let go from a bend and, from rest, pulled at one tendon: a second each, as candidates of its
parameters, all of them a batch in Warp, one after the other in MuJoCo. Identification lives on differences between
candidates, so it is also told how far off these are, at both steps of `trunkline/identification/fit/linearisation.py`,
and what Warp cannot give to each simulation. On which device is Warp's choice. It takes what no extra of the project
has:

    pip install mujoco-warp==4.0.0 warp-lang==1.19.0
"""

import argparse
import dataclasses
import importlib
import sys
from contextlib import redirect_stdout
from importlib.metadata import version
from itertools import product

import mujoco
import numpy as np

from stages.build_mjcf import Config, cad_arm
from trunkline.errors import InputError, in_one_line
from trunkline.identification.fit.linearisation import DIFFERENCE, RUBBING_DIFFERENCE
from trunkline.identification.parameters.parameters import PARAMETERS, Fields, candidate_fields, set_fields
from trunkline.identification.simulate.experiment import SLACK
from trunkline.model.elements import arm_hinges, unload_branches
from trunkline.model.simulation.motion import batch_of, hold
from trunkline.pipeline.config import load_config
from upkeep.results import recorded

SECONDS, TOLD = 1.0, (0.1, 0.3, 1.0)  # s
BEND, PULL, WINDING = 0.04, 0.03, 0.5  # rad of each y hinge, half as much of each x hinge; m, within so many s
CHANGED, BY = ("stiffness", "damping", "relaxation", "kp", "time_constant"), (DIFFERENCE, RUBBING_DIFFERENCE)


@in_one_line
def main() -> int:
    argparse.ArgumentParser(prog="studies.warp", description=(__doc__ or "").partition("\n")[0]).parse_args()
    try:
        warp, mujoco_warp = importlib.import_module("warp"), importlib.import_module("mujoco_warp")
    except ImportError:
        raise InputError("studies.warp: found no library mujoco_warp, expected it (its first lines say how)") from None
    with redirect_stdout(sys.stderr):  # it tells of what it compiles, and where
        device = warp.get_device()
    with recorded("warp"):
        names = ("mujoco-warp", "warp-lang", "mujoco")
        print(f"{', '.join(f'{name} {version(name)}' for name in names)}; device {device}")
        report(mujoco_warp)
    return 0


def report(mujoco_warp) -> None:
    model = arm()
    columns = [*(f"off within {told} s" for told in TOLD), "derivatives, by steps of", *CHANGED]
    print(f"| trial, moves by | {' | '.join(columns)} |")
    print(f"|---|{'---:|' * len(columns)}")
    for kind, (start, controls) in {"let go": let_go(model), "pulled": pulled(model)}.items():
        fields = changed(model)
        with redirect_stdout(sys.stderr):
            theirs = by_warp(mujoco_warp, model, fields, start, controls)
        ours = by_mujoco(model, fields, start, controls)
        off = 1e6 * np.linalg.norm(theirs - ours, axis=-1).max(axis=(0, 2))  # by step
        told = [f"{off[: round(until / model.opt.timestep)].max():.2f} µm" for until in TOLD]
        moved = 1e3 * np.linalg.norm(ours - ours[:, :1], axis=-1).max()
        shares = [share(their - theirs[0], our - ours[0]) for their, our in zip(theirs[1:], ours[1:], strict=True)]
        for row, size in enumerate(BY):
            own = shares[row * len(CHANGED) :][: len(CHANGED)]
            first = [""] * (1 + len(TOLD)) if row else [f"{kind}, {moved:.0f} mm", *told]
            print(f"| {' | '.join([*first, f'{size:.1%}', *own])} |")
    print(f"not for each simulation on its own: {', '.join(shared(mujoco_warp))}")


def arm() -> mujoco.MjModel:
    """The pipeline's CAD arm, of which nothing touches anything."""
    model = cad_arm(load_config(Config, "build_mjcf")).spec.compile()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ISLAND
    return model


def changed(model: mujoco.MjModel) -> Fields:
    """Of the model itself, and of candidates in which one parameter is larger: all of them by each of `BY`."""
    values = {name: np.full(1 + len(CHANGED) * len(BY), PARAMETERS[name].read(model)) for name in CHANGED}
    for candidate, (size, name) in enumerate(product(BY, CHANGED), start=1):
        values[name][candidate] *= 1 + size
    return candidate_fields(model, values)


def let_go(model: mujoco.MjModel) -> tuple[mujoco.MjData, np.ndarray]:
    """Bent, and all tendons slack: where it begins, and the controls, m. Shape (T, K)."""
    controls = np.tile(model.tendon_length0[model.actuator_trnid[:, 0]] + SLACK, (_steps(model), 1))
    start = _held(model, controls[0])
    start.qpos[: arm_hinges(model)] = np.tile([0.5 * BEND, BEND], arm_hinges(model) // 2)
    unload_branches(model, start.qpos)
    return start, controls


def pulled(model: mujoco.MjModel) -> tuple[mujoco.MjData, np.ndarray]:
    """Straight, and one tendon drawn in: as `let_go`."""
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    controls = np.tile(straight + SLACK, (_steps(model), 1))
    shares = np.minimum(np.arange(len(controls)) * model.opt.timestep / WINDING, 1)
    controls[:, 0] = straight[0] - PULL * shares
    return _held(model, controls[0]), controls


def _steps(model: mujoco.MjModel) -> int:
    return round(SECONDS / model.opt.timestep)


def _held(model: mujoco.MjModel, controls: np.ndarray) -> mujoco.MjData:
    """Motors where they are once `controls` were sent long ago."""
    batch, data = batch_of(model, 1), mujoco.MjData(model)
    batch.reset()
    hold(batch, model, controls[None])
    for name in ("ctrl", "act", "history"):
        getattr(data, name)[:] = batch.bind(name)[0]
    return data


def by_mujoco(model: mujoco.MjModel, fields: Fields, start: mujoco.MjData, controls: np.ndarray) -> np.ndarray:
    """Where the sites are before each step, m. Shape (C, T, S, 3)."""
    found = np.empty((len(next(iter(fields.values()))), len(controls), model.nsite, 3))
    for candidate, sites in enumerate(found):
        own, data = model.__copy__(), start.__copy__()
        set_fields(own, fields, candidate)
        for sent, seen in zip(controls, sites, strict=True):
            data.ctrl[:] = sent
            mujoco.mj_step(own, data)
            seen[:] = data.site_xpos
    return found


def by_warp(
    mujoco_warp, model: mujoco.MjModel, fields: Fields, start: mujoco.MjData, controls: np.ndarray
) -> np.ndarray:
    """As `by_mujoco`."""
    count = len(next(iter(fields.values())))
    there = mujoco_warp.put_model(model, dict.fromkeys(fields, count))
    for name, values in fields.items():
        getattr(there, name).assign(values.astype(np.float32))
    state, found = mujoco_warp.put_data(model, start, nworld=count), np.empty((count, len(controls), model.nsite, 3))
    for step, sent in enumerate(controls):
        state.ctrl.assign(np.tile(sent.astype(np.float32), (count, 1)))
        mujoco_warp.step(there, state)
        found[:, step] = state.site_xpos.numpy()
    return found


def share(theirs: np.ndarray, ours: np.ndarray) -> str:
    """Of a difference, by how much Warp's is off, RMS over all sites and steps; - where there is none."""
    size = np.sqrt((ours**2).mean())
    return f"{np.sqrt(((theirs - ours) ** 2).mean()) / size:.2%}" if size > 1e-12 else "-"


def shared(mujoco_warp) -> list[str]:
    """What needs a field of the model that Warp has once for all; `numeric_data` is no matter of a step."""
    specs = {field.name: getattr(field.type, "shape", ()) for field in dataclasses.fields(mujoco_warp.Model)}
    own = {field for field, shape in specs.items() if shape and shape[0] == "*"} | {"numeric_data"}
    wanted = {name: set(parameter.fields) for name, parameter in PARAMETERS.items()}
    wanted["capstan_friction"] |= {"tendon_frictionloss", "wrap_prm"}  # as trunkline/model/simulation/capstan.py
    return [f"{name} ({', '.join(sorted(fields - own))})" for name, fields in wanted.items() if fields - own]


if __name__ == "__main__":
    sys.exit(main())
