"""How MuJoCo's Unity plug-in runs a scene, call by call, so that what it makes of an arm can be tested without Unity.

After `MjScene.cs` and the components that it calls (org.mujoco 3.7 to 3.12, the same in all of them): a model of all
arms is compiled when the scene starts, and anew whenever one comes or goes; then angles and speeds are carried over
and activations are not. Controls stand in components and reach MuJoCo's data when these are synchronized, after a step.
"""

from dataclasses import dataclass, field
from typing import Protocol

import mujoco
import numpy as np

VERSION = "3.12.0"  # of org.mujoco, the newest release whose sources were read
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
APART = 2.0  # m, between the arms of a scene


@dataclass(frozen=True)
class Imported:
    """An arm in a scene: what stands before its names there, its MJCF `as_imported`, its root's quaternion, w first,
    and the name of the `MjMocapBody` above the root, none where it stands still."""

    prefix: str
    mjcf: str
    turn: tuple[float, float, float, float] = UPRIGHT
    mount: str = ""


class Component(Protocol):
    """What hears of a scene's events."""

    def compiled(self, scene: "Scene") -> None:
        """`postInitEvent`: there is a new model, its data as they begin."""
        ...

    def before_step(self, scene: "Scene") -> None:
        """`preUpdateEvent`."""
        ...

    def after_step(self, scene: "Scene") -> None:
        """`postUpdateEvent`."""
        ...


@dataclass
class Scene:
    """One of the plug-in's scenes.

    Attributes:
        arms: those in it now. components: that listen, in their order.
        gravity: Physics.gravity in MuJoCo's axes, m/s². Shape (3,). step: Time.fixedDeltaTime, s. Both have 32 bits.
        controls: `MjActuator.Control` by the actuator's name in the scene, where it is not 0.
        model, data: MuJoCo's own, after `start`.
    """

    arms: list[Imported]
    components: list[Component]
    gravity: np.ndarray
    step: float
    controls: dict[str, float] = field(default_factory=dict)
    model: mujoco.MjModel = field(init=False)
    data: mujoco.MjData = field(init=False)

    def start(self) -> None:
        """`Start`: the scene is compiled for the first time."""
        self._create()

    def fixed_update(self, count: int = 1) -> None:
        """`FixedUpdate`, `count` times.

        Raises:
            RuntimeError: MuJoCo warns, at which the plug-in stops the scene.
        """
        for _ in range(count):
            for component in self.components:
                component.before_step(self)
            mujoco.mj_step(self.model, self.data)
            if warned := [w for w in range(len(self.data.warning)) if self.data.warning[w].number]:
                raise RuntimeError(f"MuJoCo warns: {mujoco.mjtWarning(warned[0]).name}")
            self._synchronize()
            for component in self.components:
                component.after_step(self)

    def recreate(self) -> None:
        """`RecreateScene`: an arm has come or gone, or another of MuJoCo's components."""
        states = {name: (self.data.qpos[j], self.data.qvel[j]) for name, j in self._hinges().items()}
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_kinematics(self.model, self.data)
        self._synchronize()
        self._create()
        for name, j in self._hinges().items():
            if name in states:
                self.data.qpos[j], self.data.qvel[j] = states[name]
        mujoco.mj_kinematics(self.model, self.data)
        self._synchronize()

    def site(self, name: str) -> np.ndarray:
        """Where a site is now, m. Shape (3,)."""
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.site(name).xpos.copy()

    def _create(self) -> None:
        """`CreateScene`: controls and activations begin at 0."""
        spec = mujoco.MjSpec()
        for number, arm in enumerate(self.arms):
            arm_spec = mujoco.MjSpec.from_string(arm.mjcf)
            if number == 0:  # MjGlobalSettings, of which a scene has one
                spec.option = arm_spec.option
            parent, place, turn = spec.worldbody, [number * APART, 0.0, 0.0], arm.turn
            if arm.mount:
                parent = parent.add_body(name=arm.mount, mocap=True, pos=place, quat=turn)
                place, turn = [0.0, 0.0, 0.0], UPRIGHT
            spec.attach(arm_spec, prefix=arm.prefix, frame=parent.add_frame(pos=place, quat=turn))
        self.model = spec.compile()
        self.model.opt.gravity[:] = np.float32(self.gravity)
        self.model.opt.timestep = np.float32(self.step)
        self.data = mujoco.MjData(self.model)
        for component in self.components:
            component.compiled(self)

    def _synchronize(self) -> None:
        """`SyncUnityToMjState`, as far as it reaches back: MjActuator.OnSyncState."""
        for number in range(self.model.nu):
            self.data.ctrl[number] = np.float32(self.controls.get(self.model.actuator(number).name, 0.0))

    def _hinges(self) -> dict[str, int]:
        """Places of all joints' angles and speeds, which are the same: all are hinges."""
        return {self.model.joint(number).name: number for number in range(self.model.njnt)}
