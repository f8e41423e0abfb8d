"""Friction of tendons on their holes: the belt's closed form, and forces that balance in MuJoCo."""

import mujoco
import numpy as np
import pytest

from stages.build_mjcf import Config, cad_arm
from studies.capstan import SLIP, chords_at, fall, find_chords, rest
from trunkline.arm.joints import Joints
from trunkline.frames import gravity_in_base
from trunkline.pipeline.config import load_config
from trunkline.statics.chain import read_chain
from trunkline.statics.equilibria import actuated
from trunkline.statics.newton import new_work
from trunkline.statics.placement import place

FRICTION, PULL = 0.2, 0.05
DIFFERENCE = 1e-6  # rad


@pytest.fixture(scope="module")
def model():
    """Without friction of its own, or branches."""
    config = load_config(Config, "build_mjcf")
    config.joints = Joints()
    model = cad_arm(config).spec.compile()
    model.tendon_frictionloss[:] = 0
    return model


def chords_of(model, data, tendon):
    """Vectors from hole to hole, m, as MuJoCo wraps the tendon. Shape (n, 3)."""
    first = data.ten_wrapadr[tendon]
    points = data.wrap_xpos.reshape(-1, 3)[first : first + data.ten_wrapnum[tendon]]
    return np.diff(points, axis=0)


def test_a_belt_around_an_arc(model):
    """T_n / T_0 = exp(-μ θ): in a plane, all turns to one side are the angle of the last chord to the axis."""
    chain, data = read_chain(model), mujoco.MjData(model)
    data.qpos[1::2] = 0.1
    mujoco.mj_forward(model, data)
    work = new_work(chain.units, chain.tendons)
    place(chain, data.qpos.copy(), work.state)
    chords, turns, shares = (np.zeros((chain.units, chain.tendons)) for _ in range(3))
    find_chords(chain, work.state, chords, turns)
    wrapped = chords_of(model, data, 0)  # in the plane of the bend, and bent with it by the arm's taper
    assert chords[:, 0] == pytest.approx(np.linalg.norm(wrapped, axis=1), rel=1e-12)
    headings = np.unwrap(np.arctan2(wrapped[:, 0], -wrapped[:, 2]))
    angle = abs(headings[-1])
    assert angle > 2, "an arc"
    for side in (1, -1):
        fall(chords, chords + side * 10 * SLIP, turns, FRICTION, shares)
        assert shares[-1, 0] == pytest.approx(np.exp(-side * FRICTION * angle), rel=1e-9)
    fall(chords, chords, turns, FRICTION, shares)
    assert (shares == 1).all(), "what has not slid is held by nothing"


def test_forces_balance_in_mujoco(model):
    """Torques of springs and weight by MuJoCo, and of each chord by its own change of length with the joint."""
    chain, data = read_chain(model), mujoco.MjData(model)  # its motors pull no tendon that is shorter than commanded
    data.ctrl[:] = data.act[:] = 1.0
    commands = np.tile(model.tendon_length0 + 0.05, (2, 1))
    commands[:, 0] = model.tendon_length0[0] - PULL
    gravity = np.tile(gravity_in_base(0.0), (2, 1))
    plain = actuated(chain, commands, gravity)
    found = rest(chain, commands, gravity, np.array([0.0, FRICTION]), plain.qpos)
    assert found.good.all()
    assert found.tensions[1, 0] > 0.5
    assert found.qpos[0] == pytest.approx(plain.qpos[0], abs=1e-7)
    loose = np.zeros((1, chain.units, chain.tendons))
    chords_at(chain, np.zeros((1, model.nq)), gravity[:1].copy(), loose)
    data.qpos[:] = found.qpos[1]
    mujoco.mj_forward(model, data)
    wrapped = chords_of(model, data, 0)
    lengths = np.linalg.norm(wrapped, axis=1)
    directions = np.concatenate([[[0, 0, -1]], wrapped / lengths[:, None]])
    turns = np.arccos(np.clip((directions[1:] * directions[:-1]).sum(axis=1), -1, 1))
    slid = np.cumsum((loose[0, :, 0] - lengths)[::-1])[::-1]
    assert slid.max() > 10 * SLIP
    tensions = found.tensions[1, 0] * np.exp(-np.cumsum(FRICTION * turns * np.clip(slid / SLIP, -1, 1)))
    stretch = lengths.sum() - commands[1, 0]
    assert found.tensions[1, 0] == pytest.approx(model.actuator_gainprm[0, 0] * stretch, rel=1e-6)
    for joint, angle in enumerate(found.qpos[1]):
        ends = []
        for side in (1, -1):
            data.qpos[joint] = angle + side * DIFFERENCE
            mujoco.mj_forward(model, data)
            ends.append(np.linalg.norm(chords_of(model, data, 0), axis=1))
        data.qpos[joint] = angle
        data.qfrc_applied[joint] = -tensions @ (ends[0] - ends[1]) / (2 * DIFFERENCE)
    mujoco.mj_forward(model, data)
    left = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, left, data.qacc)
    assert np.abs(left).max() < 1e-5
