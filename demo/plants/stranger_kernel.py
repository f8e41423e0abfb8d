"""The stranger's engine: a chain of links on universal joints, one trial from its first step to its last.

Featherstone's articulated-body algorithm (Rigid Body Dynamics Algorithms, 2008, table 7.1), O(n), all spatial vectors
at the origin of the arm's frame: (angular, linear). The springs and dampers of joints are linearly implicit, which adds
h D + h² K to a joint's inertia: (M + h D + h² K) q̈ = τ(q, q̇) - h K q̇, then q̇ += h q̈, q += h q̇. First order in h.

Everything that is compiled stands in this file: numba renews a kernel on disk only when its own file changes.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

WHOLE = 6  # components of a spatial vector


class Links(NamedTuple):
    """M links of U units with K tendons, P Maxwell branches and E sliders; the straight arm points along -z.

    lengths, masses (M,): m, kg. transverse, axial (M,): moments of inertia about a link's centre, kg m².
    stiffness (M,): N m/rad, relaxed. hardening: 1/rad², c in K b (1 + c b²), b the bend from `rest` (M, 2) rad.
    stiffening: 1/rad², a of a further torque K b (exp(a b²) - 1), Fung's law. softening, softening_bend: share s and
    rad, b₀ of a further torque -K b s b² / (b² + b₀²). ovality (2,): e cos 2φ and e sin 2φ; a link is 1 + e times as
    stiff about the axis at φ from x, 1 - e times about the other.
    viscous_time: s, D = stiffness * viscous_time.
    branch_ratio, branch_time (P,): moduli over the relaxed one, and their time constants, s.
    slider_ratio (E,), slider_yield (E,): stiffness over that of the joint, and the bend at which it slides, rad.
    limit: rad, bend at which neighbours touch. limit_ratio: stiffness of the contact over the joint's.
    limit_time: s, its damping over its stiffness.
    hole_link (U,), hole_height (U,) m from the link's joint (negative), hole_radius (U,) m: of each unit's holes.
    base_radius: m, of the holes in the mount. azimuth (K,): rad, of the tendons in the mount. swirl (U,): rad, by which
    each unit's holes are beside it.
    friction: μ of a tendon on its holes. slip_length: m of travel in which friction builds up. drag: N of a hole,
    whatever the tension. stribeck, stribeck_speed: by how much of μ friction is larger where a tendon hardly slides,
    and the speed at which most of that is gone, m/s.
    cable_stiffness (K,): N/m. cable_damping: N s/m. zero (K,): m of pull by which a winch is off.
    dead_time: s. rate_limit: m/s. lag: s. max_force: N. backlash: m.
    """

    lengths: np.ndarray
    masses: np.ndarray
    transverse: np.ndarray
    axial: np.ndarray
    stiffness: np.ndarray
    hardening: float
    stiffening: float
    softening: float
    softening_bend: float
    ovality: np.ndarray
    rest: np.ndarray
    viscous_time: float
    branch_ratio: np.ndarray
    branch_time: np.ndarray
    slider_ratio: np.ndarray
    slider_yield: np.ndarray
    limit: float
    limit_ratio: float
    limit_time: float
    hole_link: np.ndarray
    hole_height: np.ndarray
    hole_radius: np.ndarray
    base_radius: float
    azimuth: np.ndarray
    swirl: np.ndarray
    friction: float
    slip_length: float
    drag: float
    stribeck: float
    stribeck_speed: float
    cable_stiffness: np.ndarray
    cable_damping: float
    zero: np.ndarray
    dead_time: float
    rate_limit: float
    lag: float
    max_force: float
    backlash: float


class LinkState(NamedTuple):
    """Of one arm. q, v (M, 2): rad and rad/s about x, then y. branches (P, M, 2): N m. sliders (E, M, 2): rad.
    slips (K, U + 1): friction at each hole over its bound, -1 to 1, positive if the tendon slides to the motor.
    motors, winches (K,): m of pull, before and behind the backlash."""

    q: np.ndarray
    v: np.ndarray
    branches: np.ndarray
    sliders: np.ndarray
    slips: np.ndarray
    motors: np.ndarray
    winches: np.ndarray


class Work(NamedTuple):
    """What a step computes on its way; allocated once. Spatial vectors first angular, then linear, at the origin."""

    frames: np.ndarray  # (M, 3, 3), columns: a link's axes
    joints: np.ndarray  # (M + 1, 3), of the joints and the tip, m
    axes: np.ndarray  # (M, 2, 6)
    moving: np.ndarray  # (M, 6), velocity
    turning: np.ndarray  # (M, 6), acceleration at q̈ = 0 beyond the parent's
    pushed: np.ndarray  # (M, 6), forces of tendons
    torque: np.ndarray  # (M, 2)
    added: np.ndarray  # (M, 3), h D + h² K: xx, xy, yy
    reach: np.ndarray  # (M, 2, 6), U of table 7.1
    inverse: np.ndarray  # (M, 3), of the 2 × 2 joint inertia: xx, xy, yy
    unbalanced: np.ndarray  # (M, 2), u of table 7.1
    holes: np.ndarray  # (U + 1, 3), of one tendon, m
    hole_speeds: np.ndarray  # (U + 1, 3), m/s
    chords: np.ndarray  # (U, 3), directions
    rates: np.ndarray  # (U,), of the chords' lengths, m/s
    tension: np.ndarray  # (K,), at the motors, N


@njit(cache=True, nogil=True, error_model="numpy")
def work_for(links, tendons):
    m, u = len(links.lengths), len(links.hole_link)
    return Work(
        np.zeros((m, 3, 3)), np.zeros((m + 1, 3)), np.zeros((m, 2, 6)), np.zeros((m, 6)), np.zeros((m, 6)),
        np.zeros((m, 6)), np.zeros((m, 2)), np.zeros((m, 3)), np.zeros((m, 2, 6)), np.zeros((m, 3)), np.zeros((m, 2)),
        np.zeros((u + 1, 3)), np.zeros((u + 1, 3)), np.zeros((u, 3)), np.zeros(u), np.zeros(tendons),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def place(links, state, work):
    """Frames, joints and axes of all links, their velocities and velocity-dependent accelerations."""
    x0, x1, x2, y0, y1, y2, z0, z1, z2 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    p0, p1, p2 = 0.0, 0.0, 0.0
    w0, w1, w2, o0, o1, o2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(links.lengths)):
        work.joints[i, 0], work.joints[i, 1], work.joints[i, 2] = p0, p1, p2
        for k in range(2):
            if k == 0:  # about the parent's x
                a0, a1, a2 = x0, x1, x2
            else:  # about y, as x has turned it
                c, s = np.cos(state.q[i, 0]), np.sin(state.q[i, 0])
                y0, y1, y2, z0, z1, z2 = (
                    c * y0 + s * z0, c * y1 + s * z1, c * y2 + s * z2,
                    c * z0 - s * y0, c * z1 - s * y1, c * z2 - s * y2,
                )  # fmt: skip
                a0, a1, a2 = y0, y1, y2
            b0, b1, b2 = p1 * a2 - p2 * a1, p2 * a0 - p0 * a2, p0 * a1 - p1 * a0
            axis = work.axes[i, k]
            axis[0], axis[1], axis[2], axis[3], axis[4], axis[5] = a0, a1, a2, b0, b1, b2
            speed = state.v[i, k]
            turn = work.turning[i]
            if k == 0:
                turn[:] = 0.0
            turn[0] += speed * (w1 * a2 - w2 * a1)
            turn[1] += speed * (w2 * a0 - w0 * a2)
            turn[2] += speed * (w0 * a1 - w1 * a0)
            turn[3] += speed * (w1 * b2 - w2 * b1 + o1 * a2 - o2 * a1)
            turn[4] += speed * (w2 * b0 - w0 * b2 + o2 * a0 - o0 * a2)
            turn[5] += speed * (w0 * b1 - w1 * b0 + o0 * a1 - o1 * a0)
            w0, w1, w2 = w0 + speed * a0, w1 + speed * a1, w2 + speed * a2
            o0, o1, o2 = o0 + speed * b0, o1 + speed * b1, o2 + speed * b2
        c, s = np.cos(state.q[i, 1]), np.sin(state.q[i, 1])
        x0, x1, x2, z0, z1, z2 = (
            c * x0 - s * z0, c * x1 - s * z1, c * x2 - s * z2,
            c * z0 + s * x0, c * z1 + s * x1, c * z2 + s * x2,
        )  # fmt: skip
        frame, moving = work.frames[i], work.moving[i]
        frame[0, 0], frame[1, 0], frame[2, 0] = x0, x1, x2
        frame[0, 1], frame[1, 1], frame[2, 1] = y0, y1, y2
        frame[0, 2], frame[1, 2], frame[2, 2] = z0, z1, z2
        moving[0], moving[1], moving[2], moving[3], moving[4], moving[5] = w0, w1, w2, o0, o1, o2
        length = links.lengths[i]
        p0, p1, p2 = p0 - length * z0, p1 - length * z1, p2 - length * z2
    m = len(links.lengths)
    work.joints[m, 0], work.joints[m, 1], work.joints[m, 2] = p0, p1, p2


@njit(cache=True, nogil=True, error_model="numpy")
def bend(links, state, work, h, damping, relaxed):
    """Torques of the joints at the end of the step as far as q̇ says, and what they add to the joints' inertia.

    damping: factor of the dampers. relaxed: whether the Maxwell branches have had all time, so that they bear nothing.
    """
    for i in range(len(links.lengths)):
        stiffness = links.stiffness[i]
        qx, qy = state.q[i, 0] - links.rest[i, 0], state.q[i, 1] - links.rest[i, 1]
        vx, vy = state.v[i, 0], state.v[i, 1]
        hard = stiffness * links.hardening
        square = qx * qx + qy * qy
        tx, ty = -(stiffness + hard * square) * qx, -(stiffness + hard * square) * qy
        kx, ky = stiffness + hard * (square + 2 * qx * qx), stiffness + hard * (square + 2 * qy * qy)
        kxy, dxy = 2 * hard * qx * qy, 0.0
        secant, slope = 0.0, 0.0  # of the further torque over K b, and its derivative by b²
        if links.stiffening > 0:
            grown = np.exp(links.stiffening * square)
            secant, slope = grown - 1, links.stiffening * grown
        if links.softening > 0:
            spread = square + links.softening_bend**2
            secant -= links.softening * square / spread
            slope -= links.softening * (links.softening_bend / spread) ** 2
        if secant != 0:
            tx, ty = tx - stiffness * secant * qx, ty - stiffness * secant * qy
            kx, ky = kx + stiffness * (secant + 2 * slope * qx * qx), ky + stiffness * (secant + 2 * slope * qy * qy)
            kxy += stiffness * 2 * slope * qx * qy
        if links.ovality[0] != 0 or links.ovality[1] != 0:
            even, cross = stiffness * links.ovality[0], stiffness * links.ovality[1]
            tx, ty = tx - even * qx - cross * qy, ty + even * qy - cross * qx
            kx, kxy, ky = kx + even, kxy + cross, ky - even
        d = damping * stiffness * links.viscous_time
        tx, ty = tx - d * vx, ty - d * vy
        dx = dy = d
        if not relaxed:
            for j in range(len(links.branch_time)):
                x = h / links.branch_time[j]
                decay = np.exp(-x)
                remaining = stiffness * links.branch_ratio[j] * (1 - decay) / x
                tx, ty = tx - decay * state.branches[j, i, 0], ty - decay * state.branches[j, i, 1]
                kx, ky = kx + remaining, ky + remaining
        for j in range(len(links.slider_yield)):
            x, y, k = state.sliders[j, i, 0], state.sliders[j, i, 1], stiffness * links.slider_ratio[j]
            tx, ty = tx - k * x, ty - k * y
            nx, ny = x + h * vx, y + h * vy
            if nx * nx + ny * ny < links.slider_yield[j] ** 2:
                kx, ky = kx + k, ky + k
        whole = np.sqrt(state.q[i, 0] ** 2 + state.q[i, 1] ** 2)
        if whole > links.limit:
            nx, ny = state.q[i, 0] / whole, state.q[i, 1] / whole
            k = links.limit_ratio * stiffness
            closing = nx * vx + ny * vy
            push = k * (whole - links.limit + links.limit_time * closing)
            if push > 0:
                tx, ty = tx - push * nx, ty - push * ny
                kx, kxy, ky = kx + k * nx * nx, kxy + k * nx * ny, ky + k * ny * ny
                d = k * links.limit_time
                dx, dxy, dy = dx + d * nx * nx, dxy + d * nx * ny, dy + d * ny * ny
        work.torque[i, 0] = tx - h * (kx * vx + kxy * vy)
        work.torque[i, 1] = ty - h * (kxy * vx + ky * vy)
        added = work.added[i]
        added[0], added[1], added[2] = h * dx + h * h * kx, h * dxy + h * h * kxy, h * dy + h * h * ky


@njit(cache=True, nogil=True, error_model="numpy")
def pull(links, state, work, h, hand, straight):
    """Forces of the tendons on the links, by straight chords from hole to hole, and the slip at the holes.

    A motor's spring is between winch and mount; from there to the last hole the tendon is inextensible, so that at
    hole u it slides to the motor as fast as all chords beyond shorten. At a hole where it turns by θ, tension falls by
    exp(-μ θ s) and by `drag` s, s the slip's share: Dahl's law, ds = (1 - s sign(dx)) dx / slip_length, which is ±1
    when it slides steadily, holds at rest without creep, and does not depend on rate (μ does, by `stribeck`).
    hand (K,): N, pulls without friction. straight (K,): m, length of the path in the straight arm.
    """
    units = len(links.hole_link)
    work.pushed[:] = 0.0
    for k in range(len(links.azimuth)):
        cosine, sine = np.cos(links.azimuth[k]), np.sin(links.azimuth[k])
        holes, speeds, chords = work.holes, work.hole_speeds, work.chords
        holes[0, 0], holes[0, 1], holes[0, 2] = links.base_radius * cosine, links.base_radius * sine, 0.0
        path, lengthening = 0.0, 0.0
        for u in range(units):
            i = links.hole_link[u]
            frame, moving = work.frames[i], work.moving[i]
            x, y, z = links.hole_radius[u] * cosine, links.hole_radius[u] * sine, links.hole_height[u]
            if links.swirl[u] != 0:
                c, s = np.cos(links.swirl[u]), np.sin(links.swirl[u])
                x, y = c * x - s * y, s * x + c * y
            for a in range(3):
                holes[u + 1, a] = work.joints[i, a] + frame[a, 0] * x + frame[a, 1] * y + frame[a, 2] * z
            h0, h1, h2 = holes[u + 1, 0], holes[u + 1, 1], holes[u + 1, 2]
            speeds[u + 1, 0] = moving[3] + moving[1] * h2 - moving[2] * h1
            speeds[u + 1, 1] = moving[4] + moving[2] * h0 - moving[0] * h2
            speeds[u + 1, 2] = moving[5] + moving[0] * h1 - moving[1] * h0
            square = 0.0
            for a in range(3):
                chords[u, a] = holes[u + 1, a] - holes[u, a]
                square += chords[u, a] ** 2
            length = np.sqrt(square)
            rate = 0.0
            for a in range(3):
                chords[u, a] /= length
                rate += chords[u, a] * (speeds[u + 1, a] - speeds[u, a])
            work.rates[u] = rate
            path += length
            lengthening += rate
        stretch = path - straight[k] + state.winches[k] + links.zero[k]
        force = 0.0
        if stretch > 0:
            force = max(links.cable_stiffness[k] * stretch + links.cable_damping * lengthening, 0.0)
        work.tension[k] = force
        before0, before1, before2 = 0.0, 0.0, -1.0  # from the winch the tendon comes along the mount's axis
        beyond = lengthening
        for u in range(units + 1):
            if u < units:
                c0, c1, c2 = chords[u, 0], chords[u, 1], chords[u, 2]
                gap = np.sqrt((c0 - before0) ** 2 + (c1 - before1) ** 2 + (c2 - before2) ** 2)
                sliding = -beyond * h / links.slip_length
                toward = 1.0 if sliding > 0 else -1.0
                slip = toward + (state.slips[k, u] - toward) * np.exp(-abs(sliding))
                state.slips[k, u] = slip
                rubbing = links.friction
                if links.stribeck > 0:
                    rubbing *= 1 + links.stribeck * np.exp(-abs(beyond) / links.stribeck_speed)
                after = force * np.exp(-rubbing * 2 * np.arcsin(min(0.5 * gap, 1.0)) * slip)
                if links.drag > 0:  # no more than the tension itself: a slack tendon rubs nowhere
                    after = max(after - min(links.drag, force) * slip, 0.0)
                beyond -= work.rates[u]
            else:
                c0 = c1 = c2 = after = 0.0
            if u > 0:
                ahead, behind = after + hand[k], force + hand[k]
                if u == units:
                    ahead = 0.0
                f0, f1, f2 = (
                    ahead * c0 - behind * before0, ahead * c1 - behind * before1, ahead * c2 - behind * before2
                )  # fmt: skip
                h0, h1, h2 = holes[u, 0], holes[u, 1], holes[u, 2]
                pushed = work.pushed[links.hole_link[u - 1]]
                pushed[0] += h1 * f2 - h2 * f1
                pushed[1] += h2 * f0 - h0 * f2
                pushed[2] += h0 * f1 - h1 * f0
                pushed[3] += f0
                pushed[4] += f1
                pushed[5] += f2
            force = after
            before0, before1, before2 = c0, c1, c2


@njit(cache=True, nogil=True, error_model="numpy")
def accelerate(links, state, work, h, gravity, load):
    """Articulated-body algorithm: the joints' accelerations, and with them the new speeds. load: kg at the tip."""
    count = len(links.lengths)
    inertia, bias = np.zeros((WHOLE, WHOLE)), np.zeros(WHOLE)
    for i in range(count - 1, -1, -1):
        frame, moving = work.frames[i], work.moving[i]
        mass, half = links.masses[i], 0.5 * links.lengths[i]
        for part in range(2 if i == count - 1 and load > 0 else 1):
            if part == 1:
                mass, half = load, links.lengths[i]
            z0, z1, z2 = frame[0, 2], frame[1, 2], frame[2, 2]
            c0, c1, c2 = (
                work.joints[i, 0] - half * z0, work.joints[i, 1] - half * z1, work.joints[i, 2] - half * z2
            )  # fmt: skip
            it = links.transverse[i] if part == 0 else 0.0
            more = links.axial[i] - it if part == 0 else 0.0
            square = c0 * c0 + c1 * c1 + c2 * c2
            a00 = it + more * z0 * z0 + mass * (square - c0 * c0)
            a11 = it + more * z1 * z1 + mass * (square - c1 * c1)
            a22 = it + more * z2 * z2 + mass * (square - c2 * c2)
            a01 = more * z0 * z1 - mass * c0 * c1
            a02 = more * z0 * z2 - mass * c0 * c2
            a12 = more * z1 * z2 - mass * c1 * c2
            w0, w1, w2, o0, o1, o2 = moving[0], moving[1], moving[2], moving[3], moving[4], moving[5]
            l0 = mass * (o0 + w1 * c2 - w2 * c1)
            l1 = mass * (o1 + w2 * c0 - w0 * c2)
            l2 = mass * (o2 + w0 * c1 - w1 * c0)
            m0 = a00 * w0 + a01 * w1 + a02 * w2 + mass * (c1 * o2 - c2 * o1)
            m1 = a01 * w0 + a11 * w1 + a12 * w2 + mass * (c2 * o0 - c0 * o2)
            m2 = a02 * w0 + a12 * w1 + a22 * w2 + mass * (c0 * o1 - c1 * o0)
            bias[0] += w1 * m2 - w2 * m1 + o1 * l2 - o2 * l1
            bias[1] += w2 * m0 - w0 * m2 + o2 * l0 - o0 * l2
            bias[2] += w0 * m1 - w1 * m0 + o0 * l1 - o1 * l0
            bias[3] += w1 * l2 - w2 * l1
            bias[4] += w2 * l0 - w0 * l2
            bias[5] += w0 * l1 - w1 * l0
            inertia[0, 0] += a00
            inertia[1, 1] += a11
            inertia[2, 2] += a22
            inertia[0, 1] += a01
            inertia[1, 0] += a01
            inertia[0, 2] += a02
            inertia[2, 0] += a02
            inertia[1, 2] += a12
            inertia[2, 1] += a12
            for a in range(3):
                inertia[3 + a, 3 + a] += mass
            inertia[0, 4] -= mass * c2
            inertia[4, 0] -= mass * c2
            inertia[0, 5] += mass * c1
            inertia[5, 0] += mass * c1
            inertia[1, 3] += mass * c2
            inertia[3, 1] += mass * c2
            inertia[1, 5] -= mass * c0
            inertia[5, 1] -= mass * c0
            inertia[2, 3] -= mass * c1
            inertia[3, 2] -= mass * c1
            inertia[2, 4] += mass * c0
            inertia[4, 2] += mass * c0
        axis, reach, turn = work.axes[i], work.reach[i], work.turning[i]
        for a in range(WHOLE):
            bias[a] -= work.pushed[i, a]
            r0, r1 = 0.0, 0.0
            for b in range(WHOLE):
                r0 += inertia[a, b] * axis[0, b]
                r1 += inertia[a, b] * axis[1, b]
            reach[0, a], reach[1, a] = r0, r1
        d00, d01, d11 = work.added[i, 0], work.added[i, 1], work.added[i, 2]
        u0, u1 = work.torque[i, 0], work.torque[i, 1]
        for a in range(WHOLE):
            d00 += axis[0, a] * reach[0, a]
            d01 += axis[0, a] * reach[1, a]
            d11 += axis[1, a] * reach[1, a]
            u0 -= axis[0, a] * bias[a]
            u1 -= axis[1, a] * bias[a]
        determinant = d00 * d11 - d01 * d01
        e00, e01, e11 = d11 / determinant, -d01 / determinant, d00 / determinant
        work.inverse[i, 0], work.inverse[i, 1], work.inverse[i, 2] = e00, e01, e11
        work.unbalanced[i, 0], work.unbalanced[i, 1] = u0, u1
        for a in range(WHOLE):
            g0, g1 = e00 * reach[0, a] + e01 * reach[1, a], e01 * reach[0, a] + e11 * reach[1, a]
            bias[a] += g0 * u0 + g1 * u1
            for b in range(WHOLE):
                inertia[a, b] -= g0 * reach[0, b] + g1 * reach[1, b]
        for a in range(WHOLE):
            carried = 0.0
            for b in range(WHOLE):
                carried += inertia[a, b] * turn[b]
            bias[a] += carried
    along = np.zeros(WHOLE)  # acceleration of the links; the mount's is that which gravity would give it
    along[3], along[4], along[5] = -gravity[0], -gravity[1], -gravity[2]
    for i in range(count):
        reach, axis, turn = work.reach[i], work.axes[i], work.turning[i]
        u0, u1 = work.unbalanced[i, 0], work.unbalanced[i, 1]
        for a in range(WHOLE):
            along[a] += turn[a]
            u0 -= reach[0, a] * along[a]
            u1 -= reach[1, a] * along[a]
        a0 = work.inverse[i, 0] * u0 + work.inverse[i, 1] * u1
        a1 = work.inverse[i, 1] * u0 + work.inverse[i, 2] * u1
        for a in range(WHOLE):
            along[a] += axis[0, a] * a0 + axis[1, a] * a1
        state.v[i, 0] += h * a0
        state.v[i, 1] += h * a1


@njit(cache=True, nogil=True, error_model="numpy")
def remember(links, state, h, relaxed):
    """Angles, branches and sliders at the end of a step, by the new speeds."""
    for i in range(len(links.lengths)):
        dx, dy = h * state.v[i, 0], h * state.v[i, 1]
        state.q[i, 0] += dx
        state.q[i, 1] += dy
        if not relaxed:
            for j in range(len(links.branch_time)):
                x = h / links.branch_time[j]
                decay = np.exp(-x)
                remaining = links.stiffness[i] * links.branch_ratio[j] * (1 - decay) / x
                state.branches[j, i, 0] = decay * state.branches[j, i, 0] + remaining * dx
                state.branches[j, i, 1] = decay * state.branches[j, i, 1] + remaining * dy
        for j in range(len(links.slider_yield)):
            x, y = state.sliders[j, i, 0] + dx, state.sliders[j, i, 1] + dy
            size = np.sqrt(x * x + y * y)
            share = min(1.0, links.slider_yield[j] / size) if size > 0 else 1.0
            state.sliders[j, i, 0], state.sliders[j, i, 1] = share * x, share * y


@njit(cache=True, nogil=True, error_model="numpy")
def wind(links, state, work, h, target):
    """The motors follow `target` (K,) m: a lag of first order at a limited rate, no further at their largest force."""
    for k in range(len(target)):
        rate = (target[k] - state.motors[k]) / links.lag
        rate = min(max(rate, -links.rate_limit), links.rate_limit)
        if rate > 0 and work.tension[k] >= links.max_force:
            rate = 0.0
        state.motors[k] += h * rate
        slack = 0.5 * links.backlash
        state.winches[k] = min(max(state.winches[k], state.motors[k] - slack), state.motors[k] + slack)


@njit(cache=True, nogil=True, error_model="numpy")
def advance(links, state, work, h, gravity, load, target, hand, straight, damping, relaxed):
    """One step of h s."""
    wind(links, state, work, h, target)
    place(links, state, work)
    bend(links, state, work, h, damping, relaxed)
    pull(links, state, work, h, hand, straight)
    accelerate(links, state, work, h, gravity, load)
    remember(links, state, h, relaxed)


@njit(cache=True, nogil=True, error_model="numpy")
def simulate(
    links, state, gravity, load, sent, hand, straight, rate, substeps, calm, calming, every, skipped, watched, heights,
    positions, turned, wound,
):  # fmt: skip
    """A trial from `state`, which it leaves at the trial's end.

    sent, hand (T, K): rows at `rate` Hz, each of `substeps` steps. For the first `calm` rows dampers are `calming`
    times as strong. Of every `every`-th row but the first `skipped` of these: seen (F, S, 3), points at `heights` (S,)
    m along z of the links `watched` (S,); turned (F, S, 3, 3), these links' axes; wound (F, K), of the motors.
    """
    work = work_for(links, sent.shape[1])
    h = 1.0 / (rate * substeps)
    late = round(links.dead_time * rate)
    for row in range(len(sent)):
        sample = row // every - skipped
        if row % every == 0 and 0 <= sample < len(positions):
            place(links, state, work)
            for s in range(len(watched)):
                frame = work.frames[watched[s]]
                for a in range(3):
                    positions[sample, s, a] = work.joints[watched[s], a] + heights[s] * frame[a, 2]
                    for b in range(3):
                        turned[sample, s, a, b] = frame[a, b]
            for k in range(len(state.motors)):
                wound[sample, k] = state.motors[k]
        damping = calming if row < calm else 1.0
        target = sent[max(row - late, 0)]
        for _ in range(substeps):
            advance(links, state, work, h, gravity, load, target, hand[row], straight, damping, False)


@njit(cache=True, nogil=True, error_model="numpy")
def come_to_rest(links, state, gravity, load, target, straight, h, steps, calming, still):
    """Step with strong dampers and relaxed branches until no joint turns faster than `still` rad/s; the steps taken."""
    work = work_for(links, len(target))
    hand = np.zeros(len(target))
    for step in range(steps):
        advance(links, state, work, h, gravity, load, target, hand, straight, calming, True)
        if step % 256 == 255 and np.abs(state.v).max() < still and np.abs(target - state.motors).max() < 1e-6:
            return step + 1
    return steps


@njit(cache=True, nogil=True, error_model="numpy")
def tip(links, state):
    """Where the last link ends, m. Shape (3,)."""
    work = work_for(links, len(links.azimuth))
    place(links, state, work)
    return work.joints[-1].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def path_lengths(links, state):
    """m of each tendon from its first hole to its last. Shape (K,)."""
    work = work_for(links, len(links.azimuth))
    place(links, state, work)
    lengths = np.zeros(len(links.azimuth))
    for k in range(len(lengths)):
        azimuth = links.azimuth[k]
        before = links.base_radius * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        for u in range(len(links.hole_link)):
            i = links.hole_link[u]
            radius = links.hole_radius[u]
            beside = azimuth + links.swirl[u]
            local = np.array([radius * np.cos(beside), radius * np.sin(beside), links.hole_height[u]])
            hole = work.joints[i] + work.frames[i] @ local
            lengths[k] += np.sqrt(np.sum((hole - before) ** 2))
            before = hole
    return lengths
