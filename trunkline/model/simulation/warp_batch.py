"""Batches whose rollouts are MuJoCo Warp's, on a GPU: one world a simulation, all else of them MuJoCo's own.

State and fields of each simulation stay in the rows of a `mujoco.batch.Batch`. A rollout takes them to Warp as 32-bit
floats and its end back, so constants, `forward` and `step` are as exact as ever, and positions are off from MuJoCo's as
docs/speed.md says. `trunkline.model.simulation.motion.batch_of` chooses: nothing else imports this.
"""

import copy
import dataclasses
import importlib
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS

from trunkline.compute.scheduler import BATCHES
from trunkline.errors import InputError
from trunkline.model.simulation.divergence import CountingBatch

TAKEN = ("time", "qpos", "qvel", "act", "history", "qacc_warmstart", "ctrl", "plastic")  # to Warp and back
GIVEN = ("qfrc_applied", "xfrc_applied", "eq_active", "mocap_pos", "mocap_quat")  # to Warp alone
# No step of Warp's reads these: winches are outside of steps, and lengths are for what sleeps.
UNREAD = {"numeric_data", "body_sameframe", "dof_M0", "dof_length"}
SWITCHES = ("stiffness", "damping", "frictionloss", "biasprm", "gainprm")  # Warp asks once whether any is not 0
LARGEST = mujoco.mjMAXVAL  # of an angle, a speed or an acceleration, above which MuJoCo warns
WELD = 6  # rows of an equality, the most
INSTALL = "pip install mujoco-warp==4.0.0 warp-lang==1.19.0"


class WarpBatch(CountingBatch):
    """`count` simulations of `model`, on the GPU, or slowly on the CPU where Warp finds none.

    A simulation that diverges in a rollout is warned of, and stays in the state before it; its record counts for
    nothing.

    Raises:
        InputError: there is no such library, or it cannot move this model.
    """

    def __init__(self, model: mujoco.MjModel, count: int, threads: int) -> None:
        if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
            raise unfit("a model of which parts may touch", "one without contacts: how far off those are is not known")
        if (model.actuator_history[model.actuator_history[:, 0] > 0, 1] == 0).any():
            raise unfit("a dead time without interpolation", "a linear one: of rounded times it takes another sample")
        if (model.tendon_num[model.wrap_type[model.tendon_adr] == mujoco.mjtWrap.mjWRAP_SITE] < 2).any():
            raise unfit("a cable cut down to a point", "whole ones: of such, Warp ends the process")
        self._warp, self._mujoco_warp = libraries()
        super().__init__(model, count, nthread=threads)
        self._fields = fields_of(self._mujoco_warp.Model)
        self._options = fields_of(self._mujoco_warp.Option)
        self._outputs = {name for name, shape in _shapes(self._mujoco_warp.Data).items() if shape[:1] == ("nworld",)}
        self._made: Any = None  # for which fields, what is not 0 in them
        self._there: Any = None  # Warp's model, its data, a step of them as a graph
        self._put(self._own())  # refuses here what it cannot move

    def expand(self, name: str) -> np.ndarray:
        if name in MODEL_FIELDS and not self._can_have(name):
            raise unfit(f"{name} for each simulation on its own", "what Warp can have so (cables that rub need more)")
        return super().expand(name)

    def rollout(
        self, nstep, control=None, control_spec=mujoco.mjtState.mjSTATE_CTRL.value, record=("qpos",), ids=None, out=None
    ) -> dict[Any, np.ndarray]:
        """As Batch's, but for controls alone and without `out`.

        Raises:
            InputError: a field has values that Warp cannot have for each simulation, or does not record.
        """
        if control_spec != mujoco.mjtState.mjSTATE_CTRL or out is not None:
            raise NotImplementedError("found another control_spec, or out, expected neither")
        if unknown := [name for name in (*record, *self._bound) if name not in self._outputs]:
            raise unfit(f"{unknown[0]} to be recorded", "what Warp computes")
        chosen = np.arange(self.nsim) if ids is None else np.asarray(ids)
        model, data, step = self._brought()
        copied, floats = self._warp.copy, self._warp.float32
        sent = None
        if control is not None:
            every = np.repeat(self.bind("ctrl")[None].astype(np.float32), nstep, axis=0)
            every[:, chosen] = np.broadcast_to(control, (len(chosen), nstep, self.model.nu)).swapaxes(0, 1)
            sent = self._warp.array(every, dtype=floats)
        seen = {
            name: self._warp.empty((nstep, *getattr(data, name).shape), dtype=getattr(data, name).dtype)
            for name in record
        }
        for number in range(nstep):
            if sent is not None:
                copied(data.ctrl, sent[number])
            self._warp.capture_launch(step)
            for name, rows in seen.items():
                copied(rows[number], getattr(data, name))
        self._take(data, chosen)
        found = {}
        for name, rows in seen.items():
            own = rows.numpy()[:, chosen].swapaxes(0, 1).astype(float)
            found[name] = own.reshape(len(chosen), nstep, *getattr(self._data, name).shape)
        return found

    def _take(self, data: Any, chosen: np.ndarray) -> None:
        """State and outputs of the simulations `chosen`, and which of them to warn of."""
        kinds = mujoco.mjtWarning
        moved = {"qpos": kinds.mjWARN_BADQPOS, "qvel": kinds.mjWARN_BADQVEL, "qacc": kinds.mjWARN_BADQACC}
        moved["qacc_smooth"] = kinds.mjWARN_BADQACC  # where these are no numbers, its solver may find a qacc of 0
        sound = data.overflow.numpy()[chosen] == 0
        self.warning[chosen[~sound], kinds.mjWARN_CNSTRFULL, 1] += 1
        for name, kind in moved.items():
            good = (np.abs(getattr(data, name).numpy()[chosen]) <= LARGEST).all(axis=1)  # NaN is not
            self.warning[chosen[~good], kind, 1] += 1
            sound &= good
        for name in TAKEN:
            own = self.bind(name)
            if own.size:
                own[chosen[sound]] = getattr(data, name).numpy()[chosen[sound]].reshape(-1, *own.shape[1:])
        for name, own in self._bound.items():
            own.flags.writeable = True
            own[chosen] = getattr(data, name).numpy()[chosen].reshape(-1, *own.shape[1:])
            own.flags.writeable = False

    def _can_have(self, name: str) -> bool:
        part, _, option = name.rpartition(".")
        return name in UNREAD or (option in self._options if part == "opt" else name in self._fields)

    def _own(self) -> dict[str, np.ndarray]:
        """What each simulation has of its own, of what Warp reads.

        Raises:
            InputError: it differs in what Warp has once for all, as may follow from `set_const`.
        """
        found = {name: self.expanded(name) for name in sorted(set(MODEL_FIELDS) - UNREAD)}
        own = {name: values for name, values in found.items() if values is not None}
        for name in [name for name in own if not self._can_have(name)]:
            if (own.pop(name) != getattr(self.model, name)).any():
                raise unfit(f"{name} for each simulation on its own", "what Warp can have so")
        return own

    def _brought(self) -> tuple[Any, Any, Any]:
        """Model, data and step with the fields and states that simulations have now."""
        own = self._own()
        if self._made != _kind(own):
            self._put(own)
        model, data, step = self._there
        for name, values in own.items():
            option = name.removeprefix("opt.")
            _assign(getattr(model, name) if option == name else getattr(model.opt, option), values)
        for name in (*TAKEN, *GIVEN):
            if (values := self.bind(name)).size:
                _assign(getattr(data, name), values > 0 if name == "eq_active" else values)
        data.overflow.zero_()
        return model, data, step

    def _put(self, own: dict[str, np.ndarray]) -> None:
        """Make model, data and step for these fields."""
        template, options = copy.copy(self.model), {name[4:] for name in own if name.startswith("opt.")}
        template.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # Warp never starts one anew
        for name in [name for name in own if name.endswith(SWITCHES)]:
            largest = np.abs(own[name]).argmax(axis=0)[None]
            getattr(template, name)[:] = np.take_along_axis(own[name], largest, axis=0)[0]
        rows = WELD * template.neq + template.nv + 3 * template.ntendon + 2 * template.njnt
        sizes = {name: self.nsim for name in own if not name.startswith("opt.")}
        try:
            model = self._mujoco_warp.put_model(template, sizes)
            data = self._mujoco_warp.make_data(
                template, self.nsim, nconmax=0, njmax=rows, njmax_nnz=max(rows * template.nv, 1)
            )
        except (NotImplementedError, ValueError) as error:
            raise unfit(f"a model that Warp cannot move ({error})", "another") from error
        for name in options:
            shared = getattr(model.opt, name)
            setattr(model.opt, name, self._warp.array(np.repeat(shared.numpy(), self.nsim, axis=0), dtype=shared.dtype))
        model.opt.warn_overflow = 0  # told as a warning of the simulation
        self._mujoco_warp.step(model, data)  # compiles what a graph takes; states are set before each rollout
        with self._warp.ScopedCapture() as capture:
            self._mujoco_warp.step(model, data)
        self._made, self._there = _kind(own), (model, data, capture.graph)


def libraries() -> tuple[Any, Any]:
    """warp and mujoco_warp, which say nothing of what they compile."""
    try:
        warp = importlib.import_module("warp")
        warp.config.log_level = warp.LOG_WARNING
        return warp, importlib.import_module("mujoco_warp")
    except ImportError:
        raise InputError(f"{BATCHES}: found warp but no library mujoco_warp, expected it ({INSTALL})") from None


def fields_of(kind: type) -> set[str]:
    """Names of what Warp can have for each simulation in its model or options."""
    return {name for name, shape in _shapes(kind).items() if shape[:1] == ("*",)}


def unfit(found: str, expected: str) -> InputError:
    return InputError(f"{BATCHES}: found {found}, expected {expected}; leave {BATCHES} empty to simulate it by MuJoCo")


def _shapes(kind: type) -> dict[str, tuple]:
    return {field.name: getattr(field.type, "shape", ()) or () for field in dataclasses.fields(kind)}


def _kind(own: dict[str, np.ndarray]) -> tuple:
    """What Warp's model depends on beside its values: for which fields, and what is not 0 in any simulation."""
    return tuple((name, name.endswith(SWITCHES) and values.any(axis=0).tobytes()) for name, values in own.items())


def _assign(target: Any, values: np.ndarray) -> None:
    target.assign(values.astype(np.float32 if values.dtype.kind == "f" else values.dtype))
