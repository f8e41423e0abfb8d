"""The stranger's engine: against MuJoCo, energy and closed forms; each of its effects for itself; its motors."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from demo.plants.bench import COMMAND_RATE, LOOSE, Bench
from demo.plants.stranger import OtherLaws, Stranger, StrangerSettings
from demo.plants.stranger_kernel import (
    LinkState,
    advance,
    bend,
    path_lengths,
    place,
    pull,
    remember,
    simulate,
    wind,
    work_for,
)
from tests.demo.test_laboratory import ALL
from tests.support.stranger_links import add_link
from trunkline.model.arm.spiral import spiral_chain

GRAVITY = np.array([1.0, -2.0, -9.0])
UNITS, PER = 4, 3


@pytest.fixture(scope="module")
def settings() -> StrangerSettings:
    assert isinstance(ALL.plant, StrangerSettings)
    return ALL.plant


def arm(settings: StrangerSettings, units: int = UNITS, **changes) -> Stranger:
    return Stranger(spiral_chain(0.507, 0.08, 0.012, units), replace(settings, **changes), 3, np.random.default_rng(1))


def bare(settings: StrangerSettings, units: int = UNITS, **changes) -> Stranger:
    """Springs alone: no friction, nothing that relaxes, no contact, exact motors."""
    return arm(
        settings, units,
        **{"branches": [], "sliders": [], "viscous_time": 1e-12, "friction": 0.0, "cable_damping": 0.0} | changes,
    )  # fmt: skip


def state_of(plant: Stranger, wound: float = -LOOSE, bent: float = 0.0, speed: float = 0.0) -> LinkState:
    rng = np.random.default_rng(2)
    state = plant._state(np.full(3, wound))
    state.q[:], state.v[:] = bent * rng.normal(size=state.q.shape), speed * rng.normal(size=state.q.shape)
    return state


def step(plant, state, work, h, gravity=GRAVITY, load=0.0, hand=(0.0, 0.0, 0.0), relaxed=False):
    target = state.motors.copy()
    advance(plant.links, state, work, h, gravity, load, target, np.array(hand), plant.straight, 1.0, relaxed)


def mujoco_twin(plant: Stranger, load: float) -> mujoco.MjModel:
    """The same links, hinges, springs about the same rest, and cables as spatial tendons with springs."""
    links, spec = plant.links, mujoco.MjSpec()
    spec.compiler.degree = spec.compiler.autolimits = False
    spec.option.gravity = GRAVITY
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    cables = [spec.add_tendon(name=f"cable_{k}") for k in range(3)]
    body = spec.worldbody

    def holes(name, radius, height, swirl=0.0):
        for k, (azimuth, cable) in enumerate(zip(links.azimuth, cables, strict=True)):
            place = [radius * np.cos(azimuth + swirl), radius * np.sin(azimuth + swirl), height]
            body.add_site(name=f"{name}_{k}", pos=place)
            cable.wrap_site(f"{name}_{k}")

    holes("base", links.base_radius, 0.0)
    for i in range(len(links.lengths)):
        body = add_link(body, links, i)
        for unit in np.flatnonzero(links.hole_link == i):
            holes(f"unit_{unit}", links.hole_radius[unit], links.hole_height[unit], links.swirl[unit])
    if load:
        point = body.add_body(pos=[0, 0, -links.lengths[-1]])
        point.explicitinertial, point.mass, point.inertia, point.ipos = True, load, [1e-15] * 3, [0, 0, 0]
    model = spec.compile()
    model.tendon_stiffness[:] = links.cable_stiffness
    return model


@pytest.mark.parametrize(
    ("load", "wound", "swirl"), [(0.0, -LOOSE, 0.0), (0.05, -LOOSE, 0.0), (0.05, 0.004, 0.0), (0.0, 0.004, 12.0)]
)
def test_accelerations_are_those_of_mujoco_s_twin(settings, load, wound, swirl):
    """In any pose and at any speed, with a load, with all tendons taut, and with tendons along a helix."""
    plant = bare(settings, hardening=0.0, laws=OtherLaws(swirl_deg=swirl))
    model = mujoco_twin(plant, load)
    state, h = state_of(plant, wound, 0.03, 2.0), 1e-9
    taut = path_lengths(plant.links, state) - plant.straight + wound + plant.links.zero
    assert (taut > 0).all() == (wound > 0)
    if wound < 0:
        model.tendon_stiffness[:] = 0
    model.tendon_lengthspring[:] = (plant.straight - wound - plant.links.zero)[:, None]
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = state.q.ravel(), state.v.ravel()
    mujoco.mj_forward(model, data)
    before = state.v.copy()
    step(plant, state, work_for(plant.links, 3), h, load=load)
    accelerations = (state.v - before).ravel() / h
    np.testing.assert_allclose(accelerations, data.qacc, rtol=1e-4, atol=1e-4 * np.abs(data.qacc).max())


def energy(plant: Stranger, state: LinkState) -> float:
    """J, of springs, of gravity and of motion."""
    links, work = plant.links, work_for(plant.links, 3)
    place(links, state, work)
    total = 0.0
    for i, frame in enumerate(work.frames):
        centre = work.joints[i] - links.lengths[i] / 2 * frame[:, 2]
        turning, origin = work.moving[i, :3], work.moving[i, 3:]
        speed, local = origin + np.cross(turning, centre), frame.T @ turning
        inertia = np.array([links.transverse[i], links.transverse[i], links.axial[i]])
        total += 0.5 * links.masses[i] * speed @ speed + 0.5 * inertia @ local**2 - links.masses[i] * GRAVITY @ centre
    x, y = (state.q - links.rest).T
    square, a, b = x**2 + y**2, links.stiffening, links.softening_bend
    bent = square / 2 + links.hardening * square**2 / 4
    bent += (np.exp(a * square) - 1 - a * square) / (2 * a) if a else 0.0
    bent -= links.softening / 2 * (square - b**2 * np.log(1 + square / b**2))
    bent += links.ovality[0] * (x**2 - y**2) / 2 + links.ovality[1] * x * y
    return total + float(links.stiffness @ bent)


LAWS = {
    "the model's": OtherLaws(),
    "stiffening": OtherLaws(stiffening=1.0),
    "softening": OtherLaws(softening=0.5),
    "oval": OtherLaws(ovality=0.3, ovality_deg=20.0),
}


@pytest.mark.parametrize("laws", LAWS.values(), ids=LAWS)
def test_energy_is_kept_to_first_order_in_the_step(settings, laws):
    """Nothing rubs: what the implicit step takes out halves with the step."""
    plant, lost, swung = bare(settings, limit_ratio=1e-6, laws=laws), [], []
    for steps in (4000, 8000):
        state = state_of(plant)
        state.q[:] = [0.05, 0.1]
        work, first = work_for(plant.links, 3), energy(plant, state)
        for _ in range(steps):
            step(plant, state, work, 0.2 / steps)
        lost.append(first - energy(plant, state))
        resting = energy(plant, plant._rest(GRAVITY, 0.0, np.full(3, -LOOSE)))
        swung.append(first - resting)
    assert 0 < lost[0] < 0.1 * swung[0]
    assert lost[1] / lost[0] == pytest.approx(0.5, rel=0.1)


def one_joint(settings, **changes) -> Stranger:
    """A single link of 1 kg and 0.5 m, with I = 0.1 kg m² about its centre, on a spring of 2 N m/rad."""
    plant = bare(settings, units=1, links_per_unit=1, hardening=0.0, **changes)
    plant.links = plant.links._replace(
        lengths=np.array([0.5]), masses=np.array([1.0]), transverse=np.array([0.1]), axial=np.array([0.1]),
        stiffness=np.array([2.0]), rest=np.zeros((1, 2)), hole_height=np.array([-0.25]), limit=10.0,
    )  # fmt: skip
    plant.straight = path_lengths(plant.links, plant._state(np.zeros(3)))
    return plant


def test_a_pendulum_swings_with_its_period(settings):
    """T = 2π √(I / (m g l + K)) for small angles."""
    plant = one_joint(settings)
    state, work, h = plant._state(np.full(3, -LOOSE)), work_for(plant.links, 3), 1e-4
    state.q[0] = [0.0, 1e-3]
    path = []
    for _ in range(40000):
        step(plant, state, work, h, np.array([0, 0, -9.81]))
        path.append(state.q[0, 1])
    up = np.flatnonzero((np.array(path[:-1]) < 0) & (np.array(path[1:]) >= 0))
    expected = 2 * np.pi * np.sqrt((0.1 + 0.25**2) / (9.81 * 0.25 + 2.0))
    assert h * np.diff(up).mean() == pytest.approx(expected, rel=1e-3)


def test_a_branch_relaxes_as_maxwell_says(settings):
    """Turned at a steady rate, then held: E K ω τ (1 - e^{-t/τ}), then its decay. A step is exact for a steady rate."""
    plant = one_joint(settings, branches=settings.branches)
    links, state, h, rate = plant.links, plant._state(np.full(3, -LOOSE)), 1e-3, 0.4
    ratios, times = links.branch_ratio, links.branch_time
    assert len(times) >= 2
    for count, speed in ((500, rate), (2000, 0.0)):
        for _ in range(count):
            state.v[:] = speed
            remember(links, state, h, False)
    built = 2.0 * ratios * rate * times * (1 - np.exp(-0.5 / times))
    np.testing.assert_allclose(state.branches[:, 0, 0], built * np.exp(-2.0 / times), rtol=1e-9)


def test_a_relaxing_joint_swings_as_the_linear_equations_say(settings):
    """I q̈ = -K q - Σ s - m g l q, ṡ = E K q̇ - s / τ: their matrix exponential."""
    plant = one_joint(settings, branches=settings.branches)
    ratios, times = plant.links.branch_ratio, plant.links.branch_time
    size = 2 + len(times)
    rates, inertia = np.zeros((size, size)), 0.1 + 0.25**2
    rates[0, 1], rates[1, 0], rates[1, 2:] = 1, -(2.0 + 9.81 * 0.25) / inertia, -1 / inertia
    rates[2:, 1], rates[range(2, size), range(2, size)] = 2.0 * ratios, -1 / times
    start = np.zeros(size)
    start[0] = 1e-3
    state, work, h = plant._state(np.full(3, -LOOSE)), work_for(plant.links, 3), 5e-5
    state.q[0, 0] = start[0]
    angles = []
    for _ in range(40000):
        step(plant, state, work, h, np.array([0, 0, -9.81]))
        angles.append(state.q[0, 0])
    expected = [(expm(rates * h * count) @ start)[0] for count in range(2000, 40001, 2000)]
    np.testing.assert_allclose(angles[1999::2000], expected, atol=2e-3 * start[0])


def test_a_slider_s_loop_has_its_area(settings):
    """Between ±A a Jenkins element loses 4 f (A - f / k) a cycle, f = k y its bound; in one plane, and any other."""
    plant = one_joint(settings, sliders=settings.sliders)
    links, largest = plant.links, 0.2
    stiffness, yields = 2.0 * links.slider_ratio, links.slider_yield
    expected = np.sum(4 * stiffness * yields * (largest - yields))
    for side in (np.array([1.0, 0.0]), np.array([0.6, 0.8])):
        state, count = plant._state(np.full(3, -LOOSE)), 4000
        path = largest * np.sin(2 * np.pi * np.arange(2 * count + 1) / count)
        area = 0.0
        for row, change in enumerate(np.diff(path)):
            before = state.sliders[:, 0].copy()
            state.v[0] = change * side / 1e-3
            remember(links, state, 1e-3, True)
            middle = 0.5 * (before + state.sliders[:, 0]) @ side
            area += (stiffness @ middle) * change if row >= count else 0.0
        assert area == pytest.approx(expected, rel=2e-3)


def capstan(plant: Stranger, speed: float) -> tuple[float, float, np.ndarray]:
    """Tension at the motor and in the last chord, and the angles by which the tendon turns, sliding steadily."""
    state, work = state_of(plant, 0.003), work_for(plant.links, 3)
    state.q[:, 1] = -0.02  # towards +x, where the first tendon is, so that it shortens
    state.winches[:] = [0.05, -LOOSE, -LOOSE]
    state.v[:, 1] = speed
    place(plant.links, state, work)
    for _ in range(3):
        pull(plant.links, state, work, 1.0, np.zeros(3), plant.straight)
    far = work.pushed[plant.links.hole_link[-1], 3:]
    spot = Rotation.from_rotvec([0, 0, plant.links.azimuth[0]]).apply
    chords = [np.array([0, 0, -1.0])]
    before = spot([plant.links.base_radius, 0, 0])
    for u, link in enumerate(plant.links.hole_link):
        local = spot([plant.links.hole_radius[u], 0, 0]) + [0, 0, plant.links.hole_height[u]]
        hole = work.joints[link] + work.frames[link] @ local
        chords.append((hole - before) / np.linalg.norm(hole - before))
        before = hole
    turns = [np.arccos(np.clip(a @ b, -1, 1)) for a, b in zip(chords[:-1], chords[1:], strict=True)]
    np.testing.assert_allclose(far / np.linalg.norm(far), -chords[-1], atol=1e-9)
    return work.tension[0], float(np.linalg.norm(far)), np.array(turns)


def test_tension_falls_along_a_sliding_tendon(settings):
    """exp(-μ θ) from the motor to the end where it is drawn in, exp(μ θ) where it is let out."""
    plant = arm(settings, units=8, cable_damping=0.0)
    for speed, sign in ((-1.0, -1), (1.0, 1)):
        near, far, turns = capstan(plant, speed)
        angle = turns.sum()
        assert near > 10
        assert angle > 0.3
        assert far / near == pytest.approx(np.exp(sign * settings.friction * angle), rel=1e-6)


def test_drag_takes_as_much_at_every_hole(settings):
    """T_n+1 = T_n exp(∓μ θ_n) ∓ drag, from the motor on; below the tension of the hole."""
    plant = arm(settings, units=8, cable_damping=0.0, laws=OtherLaws(drag=0.04))
    for speed, sign in ((-1.0, -1), (1.0, 1)):
        tension, far, turns = capstan(plant, speed)
        for turn in turns:
            tension = tension * np.exp(sign * settings.friction * turn) + sign * 0.04
        assert far == pytest.approx(tension, rel=1e-6)


def test_friction_falls_with_speed(settings):
    """By Stribeck: μ (1 + stribeck) where the tendon hardly slides, μ where it slides fast."""
    plant = arm(settings, units=8, cable_damping=0.0, laws=OtherLaws(stribeck=0.5, stribeck_speed=1.0))
    for speed, factor in ((-1e3, 1.0), (-1e-3, 1.5)):
        plant.links = plant.links._replace(slip_length=1e-9)
        near, far, turns = capstan(plant, speed)
        assert far / near == pytest.approx(np.exp(-factor * settings.friction * turns.sum()), rel=1e-3)


def test_a_slack_tendon_pulls_and_rubs_nowhere(settings):
    plant = arm(settings, laws=OtherLaws(drag=0.04))
    state, work = state_of(plant, -0.05, 0.01, 1.0), work_for(plant.links, 3)
    place(plant.links, state, work)
    pull(plant.links, state, work, 1e-3, np.zeros(3), plant.straight)
    assert not work.pushed.any()
    assert not work.tension.any()


def test_units_that_touch_push_each_other_apart_and_never_pull(settings):
    plant = arm(settings, branches=[], sliders=[], viscous_time=1e-12, hardening=0.0)
    links = plant.links._replace(rest=np.zeros_like(plant.links.rest))
    work = work_for(links, 3)
    for bent, speed, more in ((0.9, 0.0, 0.0), (1.1, 0.0, 1.0), (1.1, -1e4, 0.0)):
        state = plant._state(np.zeros(3))
        state.q[0], state.v[0] = bent * links.limit * np.array([0.6, 0.8]), speed * np.array([0.6, 0.8])
        bend(links, state, work, 1e-12, 1.0, True)
        extra = work.torque[0] + links.stiffness[0] * state.q[0]
        expected = -more * links.limit_ratio * links.stiffness[0] * 0.1 * links.limit * np.array([0.6, 0.8])
        np.testing.assert_allclose(extra, expected, atol=1e-6 * links.stiffness[0])


def test_motors_are_late_lag_and_stall(settings):
    motors = replace(settings.motors, dead_time=0.02, rate_limit=0.1, lag=0.05, backlash=0.0)
    plant = arm(settings, motors=motors)
    state, work = plant._state(np.zeros(3)), work_for(plant.links, 3)
    target, path = np.array([0.02, 0.002, 0.02]), []
    work.tension[2] = motors.max_force
    for _ in range(2000):
        wind(plant.links, state, work, 1e-4, target)
        path.append(state.motors.copy())
    rates = np.diff(path, axis=0) / 1e-4
    assert rates.max() == pytest.approx(0.1)  # limited at first
    np.testing.assert_allclose(np.array(path)[:, 1], 0.002 * (1 - np.exp(-1e-4 * np.arange(1, 2001) / 0.05)), atol=1e-5)
    assert state.motors[2] == 0.0, "at its largest force a motor winds no further"
    sent = np.zeros((400, 3))
    sent[100:, 0] = 0.01
    places, turns, wound = np.empty((100, 1, 3)), np.empty((100, 1, 3, 3)), np.empty((100, 3))
    state, hand, watched, heights = plant._state(np.zeros(3)), np.zeros((400, 3)), np.array([3]), np.array([-0.01])
    simulate(
        plant.links, state, GRAVITY, 0.0, sent, hand, plant.straight, COMMAND_RATE, 3, 0, 1.0, 4, 0, watched, heights,
        places, turns, wound,
    )  # fmt: skip
    started = np.flatnonzero(wound[:, 0] > 0)[0] / 500
    assert started == pytest.approx(100 / COMMAND_RATE + 0.02, abs=0.003)


def curl(plant: Stranger, level: float) -> np.ndarray:
    """Tip of a quick curl with one tendon, m."""
    time = np.arange(round(1.5 * COMMAND_RATE)) / COMMAND_RATE
    commands = np.full((1, len(time), 3), -LOOSE)
    commands[0, :, 0] = level * np.interp(time, [0.1, 0.4, 0.9, 1.2], [0, 1, 1, 0])
    down = np.array([[0, 0, -9.81]])
    bench = Bench(down, commands, np.zeros_like(commands), np.zeros(1))
    return plant.run("test", bench, [plant.chain.units - 1]).positions[0, :, 0]


def test_half_the_step_moves_what_is_recorded_by_little(settings):
    """A quick curl of an arm of 8 units, all effects on: no frame moves by more than 1 mm, on average 0.1 mm."""
    whole, half = (curl(arm(settings, units=8, substeps=count * settings.substeps), 0.03) for count in (1, 2))
    apart = np.linalg.norm(whole - half, axis=1)
    assert np.linalg.norm(whole - whole[0], axis=1).max() > 0.05
    assert apart.max() < 1e-3
    assert apart.mean() < 1e-4


def test_a_seed_is_one_stranger(settings):
    chain = spiral_chain(0.507, 0.08, 0.012, UNITS)
    first, again, other = (Stranger(chain, settings, 3, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(curl(first, 0.02), curl(again, 0.02))
    assert np.abs(curl(first, 0.02) - curl(other, 0.02)).max() > 1e-4


@pytest.mark.parametrize("hanging", [False, True])
def test_a_mount_that_is_tilted_before_leaves_the_arm_at_rest(settings, hanging):
    """A light arm of few units with loose cables: it swings from upright, or hangs where it stays."""
    plant = arm(settings, units=UNITS)
    loose = np.full((1, round(0.3 * COMMAND_RATE), 3), -LOOSE)
    bench = Bench(np.array([[6.0, 0, -7.0]]), loose, np.zeros_like(loose), np.zeros(1), hanging=hanging)
    places = plant.run("test", bench, [UNITS - 1]).positions[0, :, 0]
    assert (np.linalg.norm(places - places[0], axis=1).max() < 1e-4) == hanging


def test_its_answers_are_those_of_the_arm_that_it_is(settings):
    """A unit pressed by a torque bends by that over the stiffness told; the mean factor is 1; the lean is as large."""
    plant = arm(settings)
    answers = plant.answers()
    first = plant.links.stiffness[:PER]
    factor = answers["stiffness_factors"][0] * answers["parameters"]["stiffness"]
    assert 0.3 / factor == pytest.approx((0.3 / first).sum())
    assert answers["stiffness_factors"].mean() == pytest.approx(1)
    lean = np.hypot(answers["parameters"]["mount_tilt_x"], answers["parameters"]["mount_tilt_y"])
    assert np.degrees(lean) == pytest.approx(settings.mount_tilt_deg)
    whole = answers["rest_bend_rad"].sum(axis=0)
    np.testing.assert_allclose(whole, settings.rest_bend, atol=5 * settings.rest_scatter * np.sqrt(UNITS))
