"""How the twin starts in Unity: what `csharp/Twin.cs` does to every model that the plug-in compiles, call by call.

On the first of them the arm is settled: led to rest under the gravity and the pulls of the scene, so that it neither
falls nor creeps when it is first seen. Steps are taken with what rest does not know let go (the ties of joints that
creep, friction), and all speeds are set to 0 whenever the kinetic energy has passed a peak (dynamic relaxation with
kinetic damping: P. A. Cundall, 1976). On later models its activations are restored, which the plug-in forgets.
"""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from trunkline.unity.linearize import Laws, write_laws
from trunkline.unity.manifest import Model
from trunkline.unity.plugin import Scene

STILL = 1e-5  # rad, by which no joint has turned between two peaks of an arm at rest
PEAKS = 3  # so many of them, one after the other
LONGEST_RISE = 200  # steps that are waited for a peak: an arm that rests already has none
MOST_STEPS = 5000


@dataclass
class TwinComponent:
    """The component of one arm.

    Attributes:
        arm: the manifest's block `model`. prefix: before the arm's names in the scene.
        activations: of its actuators, m, as they were after the last step; none before it has been settled.
        pulls: the last finite controls of its actuators, m. steps: that it took to settle the arm.
    """

    arm: Model
    prefix: str = ""
    activations: np.ndarray | None = None
    pulls: dict[str, float] = field(default_factory=dict)
    steps: int = 0

    def compiled(self, scene: Scene) -> None:
        """Springs and dampers into the new model; then the arm at rest, or its activations as they were."""
        write_laws(scene.model, Laws(self.arm.springs, self.arm.dampers, self.arm.diagonals), self.prefix)
        self._hold_what_is_bad(scene)
        actuators = self._actuators(scene.model)
        scene.data.ctrl[actuators] = [np.float32(scene.controls.get(name, 0.0)) for name in self._names()]
        places = scene.model.actuator_actadr[actuators]
        activations = self.activations
        if activations is None:
            angles, at_rest = self._settled(scene)
            scene.data.qpos[angles] = at_rest
            activations = self.activations = scene.data.ctrl[actuators].copy()
        scene.data.act[places[places >= 0]] = activations[places >= 0]
        mujoco.mj_forward(scene.model, scene.data)

    def before_step(self, scene: Scene) -> None:
        self._hold_what_is_bad(scene)
        actuators = self._actuators(scene.model)
        bad = actuators[~np.isfinite(scene.data.ctrl[actuators])]
        scene.data.ctrl[bad] = [scene.controls.get(scene.model.actuator(i).name, 0.0) for i in bad]

    def after_step(self, scene: Scene) -> None:
        places = scene.model.actuator_actadr[self._actuators(scene.model)]
        self.activations = np.array([scene.data.act[place] if place >= 0 else 0.0 for place in places])

    def _hold_what_is_bad(self, scene: Scene) -> None:
        """A control that is no number is set back to the last one that was."""
        for name in self._names():
            control = scene.controls.get(name, 0.0)
            if np.isfinite(control):
                self.pulls[name] = control
            else:
                scene.controls[name] = self.pulls.get(name, 0.0)

    def _names(self) -> list[str]:
        return [self.prefix + actuator.name for actuator in self.arm.actuators]

    def _actuators(self, model: mujoco.MjModel) -> np.ndarray:
        return np.array([model.actuator(name).id for name in self._names()], dtype=int)

    def _settled(self, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
        """Places of the arm's angles in `qpos`, and the angles at rest, rad. Shapes (n,); what is not the arm stands
        still. Where it finds no rest it stays straight."""
        model, data = scene.model, mujoco.MjData(scene.model)
        joint_ids = np.array([model.joint(self.prefix + name).id for name in self.arm.names.joints])
        actuators = self._actuators(model)
        others = np.setdiff1d(np.arange(model.nq), joint_ids)
        branches = {self.prefix + entry.branch: self.prefix + entry.joint for entry in self.arm.branches}
        joint = np.array([model.joint(name).id for name in branches.values()], dtype=int)
        branch = np.array([model.joint(name).id for name in branches], dtype=int)
        ties = [model.tendon(self.prefix + entry.tie).id for entry in self.arm.branches]
        cables = [model.tendon(self.prefix + name).id for name in self.arm.names.tendons]
        let_go = (
            (model.tendon_stiffness, ties),
            (model.tendon_frictionloss, cables),
            (model.dof_frictionloss, joint_ids),
        )
        saved = [values[places].copy() for values, places in let_go]
        for values, places in let_go:
            values[places] = 0
        data.ctrl[:], data.act[:] = scene.data.ctrl, scene.data.act
        places = model.actuator_actadr[actuators]
        data.act[places[places >= 0]] = data.ctrl[actuators][places >= 0]
        rests, self.steps = _led_to_rest(model, data, joint_ids, others)
        for (values, places), before in zip(let_go, saved, strict=True):
            values[places] = before
        data.qpos[branch] = data.qpos[joint]
        return joint_ids, data.qpos[joint_ids] if rests else model.qpos0[joint_ids]


def _led_to_rest(
    model: mujoco.MjModel, data: mujoco.MjData, joint_ids: np.ndarray, others: np.ndarray
) -> tuple[bool, int]:
    """Step until the arm of the joints `joint_ids` rests, with the `others` fixed; whether it does, and after how many
    steps."""
    energy, since, peaks, last = 0.0, 0, 0, data.qpos[joint_ids].copy()
    for step in range(MOST_STEPS):
        mujoco.mj_step(model, data)
        data.qpos[others], data.qvel[others] = model.qpos0[others], 0
        mujoco.mj_energyVel(model, data)
        since += 1
        if data.energy[1] >= energy and since < LONGEST_RISE:
            energy = data.energy[1]
            continue
        energy, since, data.qvel[:] = 0.0, 0, 0
        peaks = peaks + 1 if np.abs(data.qpos[joint_ids] - last).max() < STILL else 0
        last = data.qpos[joint_ids].copy()
        if peaks == PEAKS:
            return True, step + 1
    return False, MOST_STEPS
