"""Trials of another arm, or of this one with its tendons' names wrong in both topics, are refused before any fit."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support import matched_plant
from tests.support.matched_plant import curl, motion, release, small_model, static_pull, tilt
from trunkline.errors import InputError
from trunkline.identification.simulate.checks import check_trials

FRAMES = 60


@pytest.fixture(scope="module")
def model():
    return small_model()


@pytest.fixture(scope="module")
def curls(model):
    """One of each tendon, and one of two together, with cameras' noise."""
    single = [curl(model, 40, frames=FRAMES, tendon=tendon, noise=3e-4) for tendon in range(3)]
    return [*single, two_tendons(model)]


def two_tendons(model):
    pulls = np.full((FRAMES, 3), -matched_plant.SLACK)
    pulls[:, 1:] = 0.03 * np.interp(np.arange(FRAMES) * matched_plant.FRAME, [0.1, 0.3, 1], [0, 1, 1])[:, None]
    return matched_plant._trial(
        model, "curl_2_3", "curl", "identify", 30, np.array([0, 0, -9.81]), FRAMES, np.zeros(model.nq), pulls, 3e-4,
        np.random.default_rng(0),
    )  # fmt: skip


def with_columns(trial, columns):
    """The trial with the names of its tendons exchanged, in commands and in measured positions alike."""
    return replace(trial, commands=trial.commands[:, columns], tendon_positions=trial.tendon_positions[:, columns])


def refused(trial, model):
    try:
        check_trials([trial], model)
    except InputError:
        return True
    return False


def test_trials_as_they_are_pass(model, curls):
    check_trials([*curls, tilt(model, 60), release(model, 0.3, frames=20)], model)


@pytest.mark.parametrize("columns", list(itertools.permutations(range(3)))[1:])
def test_every_exchange_of_tendons_shows_in_the_curls_that_it_changes(model, curls, columns):
    for trial, pulled in zip(curls, ({0}, {1}, {2}, {1, 2}), strict=True):
        named = {columns.index(tendon) for tendon in pulled}
        assert refused(with_columns(trial, list(columns)), model) == (named != pulled), trial.name


def mirrored(trial, axis):
    """As in a left-handed frame: one axis of positions, attitudes and gravity alike points the other way."""
    mirror = np.ones(3)
    mirror[axis] = -1
    quaternions = trial.quaternions * [1, *(-mirror)]
    return replace(trial, positions=trial.positions * mirror, quaternions=quaternions, gravity=trial.gravity * mirror)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_left_handed_frame_shows_by_the_sides_of_tendons(model, curls, static_pulls, axis):
    """Mirrored in x or y, an arm that hangs looks like another that hangs: only what pulls it has a side."""
    moved = [motion(model, seed=seed, reach_mm=80, noise=3e-4) for seed in range(2)]
    assert not refused(mirrored(tilt(model, 60), axis), model)
    for trials in (curls, static_pulls, moved):
        with pytest.raises(InputError, match=r"tendons: trial .* is the base body turned .* or the frame left-handed"):
            check_trials([mirrored(trial, axis) for trial in trials], model)


@pytest.fixture(scope="module")
def static_pulls(model):
    pulls = ([30, -300, -300], [5, 30, -300], [30, -15, -15])
    return [static_pull(model, some, angle) for some in pulls for angle in (0, 25)]


@pytest.mark.parametrize("columns", [(1, 0, 2), (0, 2, 1), (2, 1, 0), (1, 2, 0), (2, 0, 1)])
def test_exchanged_tendons_show_in_static_pulls(model, static_pulls, columns):
    for trial in static_pulls:
        check_trials([trial], model)
        largest = int(np.argmax(trial.commands[0]))
        assert refused(with_columns(trial, list(columns)), model) or columns[largest] == largest, trial.name


@pytest.mark.parametrize(("third", "refused"), [(10, False), (14, True)])
def test_a_small_share_of_a_deep_pull_is_no_exchange(model, third, refused):
    """As where guide holes are askew: paths of cables that are let out differ by a tenth of what the third pulls."""
    trial = static_pull(model, [-25, 50, -22])
    trial = replace(trial, commands=1e-3 * np.array([[6, 50, third]]))
    if refused:
        with pytest.raises(InputError, match="longer than commanded"):
            check_trials([trial], model)
    else:
        check_trials([trial], model)


def test_what_looks_like_an_exchange_in_one_trial_is_refuted_by_the_others(model):
    """Two cables that are let out by nearly the same, through holes that are askew."""
    askew = replace(static_pull(model, [-44, 22, 25]), commands=1e-3 * np.array([[-44, 25, 21]]))
    others = [static_pull(model, pulls) for pulls in ([-300, 50, -300], [-300, -300, 40])]
    with pytest.raises(InputError, match="names exchanged"):
        check_trials([askew], model)
    check_trials([askew, *others], model)
    exchanged = [with_columns(trial, [0, 2, 1]) for trial in others]
    with pytest.raises(InputError, match="names exchanged"):
        check_trials([askew, *exchanged], model)
    with pytest.raises(InputError, match=f"trial {exchanged[0].name}: .*names exchanged"):  # clear by itself
        check_trials([*others, exchanged[0]], model)


def test_static_pulls_that_other_things_bend_too_pass(model):
    """What gravity bends further than tendons do, and what all tendons press."""
    trials = [static_pull(model, [10, -300, -300], 90), static_pull(model, [-300, 10, 5], 120)]
    check_trials([*trials, static_pull(model, [20, 30, 30])], model)


@pytest.mark.parametrize("seed", range(6))
def test_motions_pass_and_show_exchanged_tendons(model, seed):
    check_trials([motion(model, seed=seed, reach_mm=40, noise=3e-4, pressed=True)], model)
    trial = motion(model, seed=seed, reach_mm=80, noise=3e-4)
    check_trials([trial], model)
    late = {key: getattr(trial, key)[10:] for key in ("time", "positions", "quaternions", "measured")}
    late |= {"commands": trial.commands[:-10], "tendon_positions": trial.commands[:-10]}  # motors 80 ms ahead
    check_trials([replace(trial, **late)], model)
    message = f"tendons: trial motion_{seed}_0_identify: found the path of 'tendon_.' .* mm longer than commanded"
    for columns in ([1, 2, 0], [1, 0, 2], [2, 1, 0]):
        with pytest.raises(InputError, match=message):
            check_trials([with_columns(trial, columns)], model)


@pytest.fixture(scope="module")
def driven(model):
    """Of each kind with motors: pulls of one and of several tendons, motions, a curl."""
    pulls = ([30, -300, -300], [40, -18, -20], [-300, 25, 30])
    moved = [motion(model, seed=seed, reach_mm=80, noise=3e-4) for seed in range(2)]
    return [*(static_pull(model, some, noise=3e-4) for some in pulls), *moved, curl(model, 40, noise=3e-4)]


def with_scale(trial, factor):
    return replace(trial, commands=factor * trial.commands, tendon_positions=factor * trial.tendon_positions)


@pytest.mark.parametrize("factor", [0.01, 0.1, 0.5])
def test_pulls_that_are_commanded_too_small_show(model, driven, factor):
    check_trials(driven, model)
    for trial in driven:
        if factor == 0.5 and trial.experiment == "motion":
            continue  # the arm lags behind them by as much
        message = rf"tendons: trial {re.escape(trial.name)}: found paths that are shorter by [\d.e+]+ times the pulls"
        with pytest.raises(InputError, match=message) as caught:
            check_trials([with_scale(trial, factor)], model)
        assert "expected 0.4 to 1.5 times: are signs reversed, are commands in another unit than m" in str(caught.value)


@pytest.mark.parametrize("factor", [-1, 4, 10, 100])
def test_pulls_and_motions_that_are_reversed_or_commanded_too_large_show(model, driven, factor):
    for trial in driven:
        if trial.level is None:
            with pytest.raises(InputError, match=f"tendons: trial {re.escape(trial.name)}: found .*signs reversed"):
                check_trials([with_scale(trial, factor)], model)


def test_all_trials_of_another_scale_are_counted_and_the_first_are_named(model, driven):
    first, second, third = (re.escape(trial.name) for trial in driven[:3])
    message = f"trials {first}, {second}, {third} and 3 more: found paths that are shorter by .* to .* times"
    with pytest.raises(InputError, match=message):
        check_trials([with_scale(trial, 0.1) for trial in driven], model)
    with pytest.raises(InputError, match=f"trials {first}, {second}: found"):
        check_trials([with_scale(trial, 0.1) for trial in driven[:2]] + driven[2:], model)


def test_slack_tendons_of_an_arm_that_gravity_bends_are_let_alone(model):
    trial = static_pull(model, [10, -300, -300], 90)
    check_trials([trial], model)
    upright = replace(trial, gravity=np.array([0, 0, -9.81]))
    with pytest.raises(InputError, match="found paths that are shorter by"):
        check_trials([upright], model)


def test_weak_motors_and_soft_cables_are_let_alone(model):
    """A curl's level says how far motors were told to pull, and they may not reach it."""
    weak, soft = model.__copy__(), model.__copy__()
    weak.actuator_forcerange[:, 0] *= 0.02
    curls = [curl(weak, 90, tendon=tendon, frames=110) for tendon in range(3)]
    assert max(float(np.ptp(trial.positions, axis=0).max()) for trial in curls) < 0.2
    soft.actuator_gainprm[:, 0] *= 0.3
    soft.actuator_biasprm[:, 1] *= 0.3
    pulls = [static_pull(soft, pulls) for pulls in ([30, -300, -300], [60, -30, -30])]
    check_trials([*curls, *pulls, motion(soft, seed=1, reach_mm=60, noise=3e-4)], model)


def test_what_is_said_names_key_trial_and_both_tendons(model, curls):
    text = "tendons: trial curl_40_0_identify: found 'tendon_2' wound by 40 mm .* to the side of 'tendon_1', expected"
    with pytest.raises(InputError, match=text):
        check_trials([with_columns(curls[0], [1, 0, 2])], model)


def test_reversed_signs_show_where_the_other_tendons_are_let_out(model, curls):
    wound = curls[0].commands[:, :1]
    commands = np.concatenate([wound, -wound / 2, -wound / 2], axis=1)
    assert not refused(replace(curls[0], commands=commands), model)
    assert refused(replace(curls[0], commands=-commands), model)


@pytest.mark.parametrize(("degrees", "wrong"), [(25, False), (-25, False), (120, True), (180, True)])
def test_a_base_that_is_turned_about_the_arm_shows(model, curls, degrees, wrong):
    turn = Rotation.from_euler("z", degrees, degrees=True)
    for trial in curls[:3]:
        positions = turn.apply(trial.positions.reshape(-1, 3)).reshape(trial.positions.shape)
        assert refused(replace(trial, positions=positions, quaternions=None), model) == wrong


def test_an_arm_that_hardly_moves_is_let_alone(model):
    assert not refused(with_columns(curl(model, 2, frames=FRAMES), [1, 0, 2]), model)


def test_the_deepest_pull_is_looked_at_where_cameras_saw_it(model, curls):
    trial = replace(curls[0], measured=curls[0].measured.copy())
    trial.measured[np.argmax(trial.commands[:, 0]) :] = False
    check_trials([trial], model)
    assert refused(with_columns(trial, [1, 0, 2]), model)


def test_a_part_of_the_tendons_is_refused(model, curls):
    some = replace(
        curls[0], tendons=("tendon_1",), commands=curls[0].commands[:, :1],
        tendon_positions=curls[0].tendon_positions[:, :1],
    )  # fmt: skip
    text = "session.yaml: tendons: trial curl_40_0_identify: found tendon_1 alone, expected all of the model: tendon_1,"
    with pytest.raises(InputError, match=re.escape(text)):
        check_trials([some], model)
    named = replace(curls[0], tendons=("m1", "m2", "m3"))
    message = r"found 'm1', expected names of the model: .*; under `tendons` or `motors`, what moves which"
    with pytest.raises(InputError, match=message):
        check_trials([named], model)
    none = replace(some, tendons=(), commands=np.empty((FRAMES, 0)), tendon_positions=np.empty((FRAMES, 0)))
    check_trials([none], model)


def test_a_trial_in_no_frame_of_which_enough_is_measured_says_nothing_of_tendons(model, static_pulls):
    """It was an IndexError; the fit of its start refuses it in a line."""
    unseen = replace(static_pulls[0], measured=np.zeros_like(static_pulls[0].measured))
    check_trials([unseen, *static_pulls[1:]], model)
    with pytest.raises(InputError, match="longer than commanded"):
        check_trials([unseen, with_columns(static_pulls[1], [1, 0, 2])], model)
