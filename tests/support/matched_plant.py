"""A plant that is the model: trials simulated to be identified again.

On purpose with plain `mj_step` and not with trunkline.model.simulation, which these trials are to check.
"""

from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from tests.support.small_arm import small_spec
from trunkline.frames import gravity_in_base, wxyz_from_rotation
from trunkline.identification.parameters.saving import save_model
from trunkline.identification.simulate.experiment import SLACK
from trunkline.model.arm.joints import Joints, add_elements
from trunkline.model.arm_model import BRANCH, ArmModel
from trunkline.recordings.trials.trial import Trial

FRAME = 1 / 120


def small_model(units: int = 6, joints: Joints | None = None, **motors: float) -> mujoco.MjModel:
    """`motors`: as `small_spec` has them."""
    spec = small_spec(units, **motors)
    add_elements(spec, joints or Joints(), 1e-5)
    spec.option.timestep = FRAME / 8
    model = spec.compile()
    model.dof_damping[: ArmModel(model).hinge_count] *= 4
    model.tendon_frictionloss[ArmModel(model).cables] = 0.3
    return model


def mjcf_of(model: mujoco.MjModel) -> str:
    """The file of a model like `small_model`, whatever its parameters are."""
    spec = small_spec(model.nq // 2)
    spec.option.timestep = model.opt.timestep
    spec.compile()
    return save_model(spec, model)


def begin_project(folder: Path, units: int) -> mujoco.MjModel:
    """Write `small_model` where `build_mjcf` writes the CAD model, and make room for trials; the model."""
    model = small_model(units)
    (folder / "artifacts/build_mjcf").mkdir(parents=True)
    (folder / "artifacts/build_mjcf/arm.xml").write_text(mjcf_of(model))
    (folder / "data/processed/filter").mkdir(parents=True)
    return model


def markers_of(model: mujoco.MjModel) -> tuple[str, ...]:
    names = [model.body(i).name for i in range(model.nbody)]
    return tuple(name for name in names if name.startswith("unit_") and BRANCH not in name)


def with_load(model: mujoco.MjModel, load: float) -> mujoco.MjModel:
    """A model like `small_model` that was compiled with a point of `load` kg at its tip."""
    spec = small_spec(model.nq // 2)
    ball = spec.body(f"unit_{model.nq // 2:02d}").add_body(pos=list(spec.site("tip").pos))
    ball.explicitinertial, ball.mass, ball.ipos, ball.inertia = True, load, [0, 0, 0], [1e-12] * 3
    spec.option.timestep = model.opt.timestep
    loaded = spec.compile()
    for name in ("jnt_stiffness", "jnt_stiffnesspoly", "dof_damping", "dof_dampingpoly", "dof_frictionloss",
                 "tendon_frictionloss", "actuator_gainprm", "actuator_biasprm"):  # fmt: skip
        getattr(loaded, name)[:] = getattr(model, name)
    return loaded


def _trial(model, name, experiment, split, level, gravity, frames, start, pulls, noise, rng, substep=0.0) -> Trial:
    """Step through `frames` from the joint angles `start`; between two frames the mean of their pulls (T, K) holds."""
    model = model.__copy__()
    model.opt.gravity[:] = gravity
    data = mujoco.MjData(model)
    lengths = model.tendon_length0[ArmModel(model).cables] - pulls
    data.qpos[: len(start)], data.act[:] = start, lengths[0]
    for motor in np.flatnonzero(model.actuator_history[:, 0]):
        sent = np.full((model.actuator_history[motor, 0], 1), lengths[0, motor])
        mujoco.mj_initCtrlHistory(model, data, motor, None, sent)
    ArmModel(model).unload_branches(data.qpos)  # held for long before
    for slider in ArmModel(model).sliders:  # slipped on the way from the straight arm
        bend, give = data.qpos[slider.hinge], model.tendon_springyield[slider.tendon]
        for end in (0, 1):
            data.plastic[model.tendon_plasticadr[slider.tendon] + end] = bend - np.clip(bend, -give, give)
    furthest = (ArmModel(model).rate_limit or np.inf) * model.opt.timestep  # of a winch in a step
    slack, drum, cable = ArmModel(model).backlash / 2, lengths[0], lengths[0]
    markers = markers_of(model)
    sites = [model.site(f"{s}_center").id for s in markers]
    positions, quaternions = np.empty((frames, len(sites), 3)), np.empty((frames, len(sites), 4))
    if substep:  # the first frame is this share of a frame after the start
        step, model.opt.timestep = model.opt.timestep, substep * FRAME / 8
        data.ctrl[:] = lengths[0]
        mujoco.mj_step(model, data, 8)
        model.opt.timestep = step
    for frame in range(frames):
        mujoco.mj_forward(model, data)
        positions[frame] = data.site_xpos[sites]
        quaternions[frame] = wxyz_from_rotation(Rotation.from_matrix(data.site_xmat[sites].reshape(-1, 3, 3)))
        sent = 0.5 * (lengths[frame] + lengths[min(frame + 1, frames - 1)])
        for _ in range(round(FRAME / model.opt.timestep)):
            drum = drum + np.clip(sent - drum, -furthest, furthest)
            data.ctrl[:] = cable = np.clip(cable, drum - slack, drum + slack)
            mujoco.mj_step(model, data)
    positions = positions + rng.normal(0, noise, positions.shape)
    return Trial(
        name=name, experiment=experiment, split=split, level=level, gravity=gravity, time=np.arange(frames) * FRAME,
        markers=markers, positions=positions, quaternions=quaternions, measured=np.ones(positions.shape[:2], bool),
        tendons=("tendon_1", "tendon_2", "tendon_3"), commands=pulls, tendon_positions=pulls, start=0.0,
    )  # fmt: skip


def tilt(model, tilt_deg: float, split="identify", noise=0.0, seed=0) -> Trial:
    """At rest under tilted gravity, friction off."""
    rng = np.random.default_rng(seed)
    return _at_rest(model, f"tilt_{tilt_deg:.0f}_{split}", "static_tilt", split, tilt_deg, tilt_deg,
                    np.full((1, 3), -SLACK), noise, rng)


def static_pull(model, pulls_mm, tilt_deg=0.0, split="identify", noise=0.0, seed=0) -> Trial:
    """At rest with each tendon held at its pull, friction off."""
    pulls, rng = np.array([pulls_mm]) / 1000, np.random.default_rng(seed)
    name = "_".join(f"{pull:.0f}" for pull in pulls_mm)
    return _at_rest(model, f"pull_{name}_{tilt_deg:.0f}_{split}", "static_pull", split, None, tilt_deg, pulls,
                    noise, rng)


def _at_rest(model, name, experiment, split, level, tilt_deg, pulls, noise, rng) -> Trial:
    start, gravity = _rest_pose(model, tilt_deg, pulls), gravity_in_base(np.radians(tilt_deg))
    return _trial(model, name, experiment, split, level, gravity, 1, start, pulls, noise, rng)


def _rest_pose(model, tilt_deg, pulls) -> np.ndarray:
    """Joint angles at rest under the first of `pulls` (T, K), friction off."""
    settled = model.__copy__()
    settled.tendon_frictionloss[:] = 0
    settled.dof_damping[:] = 0.1 * settled.jnt_stiffness[settled.dof_jntid]
    settled.opt.gravity[:] = gravity_in_base(np.radians(tilt_deg))
    settled.opt.timestep = FRAME / 2  # where it rests does not depend on the steps
    data = mujoco.MjData(settled)
    data.ctrl[:] = data.act[:] = settled.tendon_length0 - pulls[0]
    mujoco.mj_step(settled, data, 1000)
    while np.abs(data.qvel).max() > 1e-6:  # rad/s; the hinges are then some 1e-6 rad from rest
        mujoco.mj_step(settled, data, 250)
    return data.qpos.copy()


def release(model, bend: float, split="identify", frames=120, noise=0.0, seed=0, substep=0.0, tilt_deg=0.0) -> Trial:
    """Let go from every y hinge at `bend` rad and every x hinge at half of it."""
    about_y = model.jnt_axis[: ArmModel(model).hinge_count, 1] == 1
    start = np.where(about_y, bend, 0.5 * bend)
    rng = np.random.default_rng(seed)
    return _trial(model, f"release_{bend:.2f}_{split}", "release", split, None,
                  gravity_in_base(np.radians(tilt_deg)), frames, start,
                  np.full((frames, 3), -SLACK), noise, rng, substep)


def curl(
    model, level_mm: float, split="identify", frames=150, noise=0.0, seed=0, tendon=0, tilt_deg=0.0
) -> Trial:
    """One tendon pulled in and out again."""
    time = np.arange(frames) * FRAME
    pulls = np.full((frames, 3), -SLACK)
    pulls[:, tendon] = level_mm / 1000 * np.interp(time, [0.1, 0.3, 0.7, 0.9], [0, 1, 1, 0])
    rng = np.random.default_rng(seed)
    start = _rest_pose(model, tilt_deg, pulls[:1]) if tilt_deg else np.zeros(model.nq)
    return _trial(model, f"curl_{level_mm:.0f}_{tendon}_{split}", "curl", split, level_mm,
                  gravity_in_base(np.radians(tilt_deg)), frames, start, pulls, noise, rng)


def motion(
    model, reach_mm=25.0, tilt_deg=0.0, split="identify", frames=240, noise=0.0, seed=0, pressed=False
) -> Trial:
    """From rest, each tendon follows sines of its own, up to `reach_mm` in all; what they all have in common presses
    the arm together, and is left out but if `pressed`."""
    rng, time = np.random.default_rng(seed), np.arange(frames) * FRAME
    angle = 2 * np.pi * rng.uniform(0.3, 1.5, (3, 3)) * np.clip(time - 0.1, 0, None)[:, None, None]
    pulls = reach_mm / 3000 * np.sin(angle).sum(axis=2)
    pulls -= 0.0 if pressed else pulls.mean(axis=1, keepdims=True)
    start, name = _rest_pose(model, tilt_deg, pulls), f"motion_{seed}_{tilt_deg:.0f}_{split}"
    return _trial(model, name, "motion", split, None, gravity_in_base(np.radians(tilt_deg)), frames, start, pulls,
                  noise, rng)
