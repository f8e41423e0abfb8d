"""A simulation that diverges is counted and prints nothing; all else that MuJoCo says is heard, as it was before."""

import threading

import mujoco
import numpy as np
import pytest

from tests.support.matched_plant import small_model
from trunkline.model.simulation.divergence import divergence_counted
from trunkline.model.simulation.motion import batch_of, move

UNSTABLE = "Nan, Inf or huge value in QACC at DOF 2. The simulation is unstable. Time = 0.0500."
OTHER = "Inertia matrix is too close to singular at DOF 0. Check model. Time = 0.0000."


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Where MuJoCo would write MUJOCO_LOG.TXT."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def wild():
    """A model that leaves the physics within a few of its long steps."""
    model = small_model(4)
    model.opt.timestep = 0.05
    model.dof_damping[:] = 0
    model.jnt_stiffness[:] *= 1e5
    return model


def bent(model, count=3):
    batch = batch_of(model, count)
    batch.bind("qpos")[:, 0] = 0.5
    batch.bind("ctrl")[:] = model.tendon_length0
    return batch


@pytest.mark.parametrize("way", ["move", "step", "rollout"])
@pytest.mark.parametrize("threads", ["1", "4"])
def test_what_diverges_is_counted_and_prints_nothing(wild, capfd, folder, monkeypatch, way, threads):
    monkeypatch.setenv("TRUNKLINE_THREADS", threads)
    batch = bent(wild)
    if way == "move":
        move(batch, np.tile(wild.tendon_length0, (3, 40, 1)), ("qpos",))
    else:
        getattr(batch, way)(nstep=40)
    assert batch.warning.any(axis=(1, 2)).all()
    assert capfd.readouterr() == ("", "")
    assert list(folder.iterdir()) == []


def test_a_model_that_is_stepped_by_itself_is_warned_of_as_ever(wild, capfd, folder):
    move(bent(wild), np.tile(wild.tendon_length0, (3, 40, 1)), ("qpos",))
    data = mujoco.MjData(wild)
    data.qpos[0] = 0.5
    for _ in range(10):
        mujoco.mj_step(wild, data)
    assert "The simulation is unstable" in "".join(capfd.readouterr())
    assert (folder / "MUJOCO_LOG.TXT").is_file()


def test_other_warnings_are_heard(capsys):
    with divergence_counted():
        heard = mujoco.get_mju_user_warning()
        heard(UNSTABLE)
        heard(OTHER)
    assert capsys.readouterr().err == f"WARNING: {OTHER}\n"


def test_who_listened_before_hears_other_warnings_and_listens_again():
    messages = []
    mujoco.set_mju_user_warning(messages.append)
    try:
        with divergence_counted():
            mujoco.get_mju_user_warning()(UNSTABLE)
            mujoco.get_mju_user_warning()(OTHER)
        assert messages == [OTHER]
        mujoco.get_mju_user_warning()(UNSTABLE)
        assert messages == [OTHER, UNSTABLE]
    finally:
        mujoco.set_mju_user_warning(None)


def test_batches_on_several_threads_leave_things_as_they_were(wild):
    """The first that begins need not be the first that ends."""
    inside, leave = threading.Event(), threading.Event()

    def first():
        with divergence_counted():
            inside.set()
            leave.wait(10)

    thread = threading.Thread(target=first)
    thread.start()
    assert inside.wait(10)
    with divergence_counted():
        leave.set()
        thread.join()
        assert mujoco.get_mju_user_warning() is not None
    assert mujoco.get_mju_user_warning() is None
