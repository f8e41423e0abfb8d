"""A plant that is the model: trials simulated step by step with plain mj_step, to be identified again."""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from tests.support.small_arm import small_spec
from trunkline.frames import gravity_in_base, wxyz_from_rotation
from trunkline.identification.experiment import SLACK
from trunkline.trials.trial import Trial

FRAME = 1 / 120


def small_model(units: int = 6) -> mujoco.MjModel:
    spec = small_spec(units)
    spec.option.timestep = FRAME / 8
    model = spec.compile()
    model.dof_damping[:] *= 4
    model.tendon_frictionloss[:] = 0.3
    return model


def segments_of(model: mujoco.MjModel) -> tuple[str, ...]:
    return tuple(model.body(i).name for i in range(2, model.nbody))


def _trial(model, name, experiment, split, level, gravity, frames, start, pulls, noise, rng, substep=0.0) -> Trial:
    """Step through `frames` from the joint angles `start`; between two frames the mean of their pulls (T, K) holds."""
    model = model.__copy__()
    model.opt.gravity[:] = gravity
    data = mujoco.MjData(model)
    lengths = model.tendon_length0 - pulls
    data.qpos[:], data.act[:] = start, lengths[0]
    segments = segments_of(model)
    sites = [model.site(f"{s}_center").id for s in segments]
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
        data.ctrl[:] = 0.5 * (lengths[frame] + lengths[min(frame + 1, frames - 1)])
        mujoco.mj_step(model, data, round(FRAME / model.opt.timestep))
    positions = positions + rng.normal(0, noise, positions.shape)
    return Trial(
        name=name, experiment=experiment, split=split, level=level, gravity=gravity, time=np.arange(frames) * FRAME,
        segments=segments, positions=positions, quaternions=quaternions, measured=np.ones(positions.shape[:2], bool),
        tendons=("tendon_1", "tendon_2", "tendon_3"), commands=pulls, tendon_positions=pulls, start=0.0,
    )  # fmt: skip


def tilt(model, tilt_deg: float, split="identify", noise=0.0, seed=0) -> Trial:
    """At rest under tilted gravity, friction off."""
    settled = model.__copy__()
    settled.tendon_frictionloss[:] = 0
    settled.dof_damping[:] = 0.1 * settled.jnt_stiffness[settled.dof_jntid]
    pulls = np.full((1, 3), -SLACK)
    gravity = gravity_in_base(np.radians(tilt_deg))
    settled.opt.gravity[:] = gravity
    data = mujoco.MjData(settled)
    data.ctrl[:] = data.act[:] = settled.tendon_length0 + SLACK
    mujoco.mj_step(settled, data, 4000)
    while np.abs(data.qvel).max() > 1e-6:  # rad/s; the hinges are then some 1e-6 rad from rest
        mujoco.mj_step(settled, data, 1000)
    rng = np.random.default_rng(seed)
    return _trial(model, f"tilt_{tilt_deg:.0f}_{split}", "static_tilt", split, tilt_deg, gravity, 1, data.qpos,
                  pulls, noise, rng)


def release(model, bend: float, split="identify", frames=120, noise=0.0, seed=0, substep=0.0) -> Trial:
    """Let go from every y hinge at `bend` rad and every x hinge at half of it."""
    start = np.tile([0.5 * bend, bend], model.nq // 2)
    rng = np.random.default_rng(seed)
    return _trial(model, f"release_{bend:.2f}_{split}", "release", split, None, gravity_in_base(0.0), frames, start,
                  np.full((frames, 3), -SLACK), noise, rng, substep)


def curl(model, level_mm: float, split="identify", frames=150, noise=0.0, seed=0, tendon=0) -> Trial:
    """One tendon pulled in and out again."""
    time = np.arange(frames) * FRAME
    pulls = np.full((frames, 3), -SLACK)
    pulls[:, tendon] = level_mm / 1000 * np.interp(time, [0.1, 0.3, 0.7, 0.9], [0, 1, 1, 0])
    rng = np.random.default_rng(seed)
    return _trial(model, f"curl_{level_mm:.0f}_{tendon}_{split}", "curl", split, level_mm, gravity_in_base(0.0),
                  frames, np.zeros(model.nq), pulls, noise, rng)
