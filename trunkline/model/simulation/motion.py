"""The one stepper: batches of simulations moved by rows of controls, MuJoCo's own loop over the steps."""

import copy

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.compute.scheduler import rough_by_warp
from trunkline.compute.threads import thread_count
from trunkline.model.simulation.capstan import rubbing
from trunkline.model.simulation.divergence import CountingBatch

CHUNK = 128  # steps a call: few calls, and records of some MB
LEAST_BY_WARP = 1000  # simulations, about, below which a GPU has too little to do at once


def batch_of(model: mujoco.MjModel, count: int, rough: bool = False) -> Batch:
    """`count` simulations of a copy of `model`, on as many threads as `thread_count` says; results do not depend on it.

    What costs time is off: contacts where nothing can touch, and the search for islands. A simulation that diverges
    stays so: MuJoCo would start it anew by itself. It is counted in `warning`, and nothing is printed.

    Args:
        rough: whether it may move by 32-bit floats, as candidates that are only ranked may. Then a large one does so on
            a GPU, where `TRUNKLINE_BATCHES` says it (`trunkline/compute/scheduler.py`).

    Raises:
        InputError: that names nothing known, or what cannot move this model.
    """
    model = copy.copy(model)
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= off.mjDSBL_AUTORESET
    if not model.geom_contype.any() and not model.geom_conaffinity.any() and not model.npair:
        model.opt.disableflags |= off.mjDSBL_CONTACT
    model.opt.disableflags |= off.mjDSBL_ISLAND
    if by_warp(count, rough):
        from trunkline.model.simulation.warp_batch import WarpBatch

        return WarpBatch(model, count, thread_count())
    return CountingBatch(model, count, nthread=thread_count())


def by_warp(count: int, rough: bool) -> bool:
    """Whether `batch_of` has such a batch moved by MuJoCo Warp."""
    return rough_by_warp() and rough and count >= LEAST_BY_WARP


def hold(batch: Batch, model: mujoco.MjModel, controls: np.ndarray, ids=slice(None)) -> None:
    """Put motors where they are once these controls (n, nu) were sent long ago, filters and dead times at rest."""
    batch.bind("ctrl")[ids] = controls
    if model.na:
        batch.bind("act")[ids] = controls[..., model.actuator_actadr >= 0]
    for motor in np.flatnonzero(model.actuator_history[:, 0]):
        samples = model.actuator_history[motor, 0]  # after two numbers of its own come their times, then their values
        first = model.actuator_historyadr[motor] + 2 + samples
        batch.bind("history")[ids, first : first + samples] = controls[..., motor, None]


def move(
    batch: Batch,
    controls: np.ndarray,
    record: tuple[str, ...],
    every: int = 1,
    at: int = 0,
    ids: np.ndarray | None = None,
    moved=lambda rows: None,
    longest: float | None = None,
) -> dict[str, np.ndarray]:
    """Take one step with each row of `controls`.

    As with `mj_step`, what a step computes on its way, positions of sites for one, belongs to the state before it;
    `qpos` and `qvel` are those after it. A simulation about which MuJoCo warns stands still for the rest of a chunk.

    Args:
        controls: of the actuators. Shape (n, T, nu), T a multiple of `every`.
        record: names of fields of MjData.
        every, at: of every `every` steps the one that is recorded.
        ids: which n simulations of the batch, all by default.
        moved: called with the number of new rows of the record.
        longest: s, the longest step of all simulations that move now, where others do elsewhere.

    Returns:
        A record for each name. Shape (n, T / every, ...).
    """
    rub = rubbing(batch, longest)
    own = np.arange(batch.nsim) if ids is None else ids
    length = rub.steps if rub else max(CHUNK // every, 1) * every
    if rub:
        rub.begin(own)
    parts: dict[str, list[np.ndarray]] = {name: [] for name in record}
    for start in range(0, controls.shape[1], length):
        if rub:
            rub.refresh(own)
        rows = np.ascontiguousarray(controls[:, start : start + length])
        found = batch.rollout(rows.shape[1], control=rows, record=record, ids=ids)
        chosen = slice((at - start) % every, None, every)
        for name, part in parts.items():
            part.append(found[name][:, chosen].copy())
        moved(len(range(rows.shape[1])[chosen]))
    return {name: np.concatenate(part, axis=1) for name, part in parts.items()}
