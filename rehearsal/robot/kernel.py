"""The stand-in's engine: the lab's stranger on a base that moves, what it touches, step after step.

The stranger's own kernel is called piece by piece, as it stands. Its pieces see a base that rests: angles, springs,
tendons and friction in holes do not depend on how the base moves. Between `pull` and `accelerate` the base's motion is
added. All spatial vectors have one frame, that of the arm's base at this moment, and one origin, so

    v_i ← v_i + v_0,    c_i ← c_i + v_0 x (S_i q̇_i),    c_1 ← c_1 + a_0,    a_0 = (ω̇, p̈ - ω x ṗ),

with v_0 = (ω, ṗ) of the base, c_i a link's velocity-dependent acceleration, S_i its joint's axes (Featherstone, Rigid
Body Dynamics Algorithms, 2008, table 7.1). Gravity is the base's acceleration upwards there already.
"""

import numpy as np

from demo.plants.stranger_kernel import accelerate, bend, place, pull, remember, wind, work_for
from rehearsal.robot.compiled import kernel
from rehearsal.robot.flange import accelerate_joints, carry, move_joints
from rehearsal.robot.rigid_object import move_object, pull_string, rotation, spin_of, transposed
from rehearsal.robot.touching import touch_all
from trunkline.model.statics.vectors import cross, plus, turned

# columns of a row of what a tick ends with
JOINTS, WOUND, TIP, TIP_AXES, OBJECT = slice(0, 7), slice(7, 10), slice(10, 13), slice(13, 22), slice(22, 29)
COLUMNS = 29


@kernel
def set_moving(work, state, turn, spin, speed, spinning, speeding):
    """Add the base's motion to `moving` and `turning` of all links. Its vectors are of the world, tuples."""
    back = transposed(turn)
    w, v, b = turned(back, spin), turned(back, speed), turned(back, spinning)
    a = plus(turned(back, speeding), -1.0, cross(w, v))
    for i in range(len(state.q)):
        axes, more = work.axes[i], work.turning[i]
        x, y = state.v[i, 0], state.v[i, 1]
        s = (axes[0, 0] * x + axes[1, 0] * y, axes[0, 1] * x + axes[1, 1] * y, axes[0, 2] * x + axes[1, 2] * y)
        o = (axes[0, 3] * x + axes[1, 3] * y, axes[0, 4] * x + axes[1, 4] * y, axes[0, 5] * x + axes[1, 5] * y)
        angular, linear = cross(w, s), plus(cross(w, o), 1.0, cross(v, s))
        for k in range(3):
            work.moving[i, k] += w[k]
            work.moving[i, 3 + k] += v[k]
            more[k] += angular[k]
            more[3 + k] += linear[k]
    for k in range(3):
        work.turning[0, k] += b[k]
        work.turning[0, 3 + k] += a[k]


@kernel
def step(h, links, state, work, straight, hand, wound, gravity, servos, mount, joints, target, discs, world, object,
         motion, contacts):  # fmt: skip
    """One step of h s. wound (K,): m, commands of the motors. target (7,): rad, commands of the Panda."""
    accelerate_joints(servos, joints, target, h)
    turn, origin, spin, speed, spinning, speeding = carry(mount, joints)
    wind(links, state, work, h, wound)
    place(links, state, work)
    bend(links, state, work, h, 1.0, False)
    pull(links, state, work, h, hand, straight)
    set_moving(work, state, turn, spin, speed, spinning, speeding)
    force, torque = touch_all(h, discs, world, object, motion, contacts, work, turn, origin)
    pose = rotation(motion.quaternion)
    hung, twisted = pull_string(object, motion, pose, spin_of(object, motion, pose))
    down = turned(transposed(turn), (gravity[0], gravity[1], gravity[2]))
    accelerate(links, state, work, h, down, 0.0)
    remember(links, state, h, False)
    move_object(object, motion, plus(force, 1.0, hung), plus(torque, 1.0, twisted), gravity, h)
    move_joints(joints, h)


@kernel
def look(links, state, work, mount, joints, motion, row):
    """Write what there is to see into `row` (COLUMNS,), in the Panda's base frame; see the slices above."""
    place(links, state, work)
    turn, origin, _, _, _, _ = carry(mount, joints)
    m = len(links.lengths)
    tip = plus(turned(turn, (work.joints[m, 0], work.joints[m, 1], work.joints[m, 2])), 1.0, origin)
    f = work.frames[m - 1]
    for k in range(7):
        row[k] = joints[0, k]
    for k in range(3):
        row[7 + k] = state.motors[k]
        row[10 + k] = tip[k]
        axis = turned(turn, (f[0, k], f[1, k], f[2, k]))
        for a in range(3):
            row[13 + 3 * a + k] = axis[a]
        row[22 + k] = motion.place[k]
    for k in range(4):
        row[25 + k] = motion.quaternion[k]


@kernel
def run(ticks, substeps, tick, links, state, straight, wound, gravity, servos, mount, joints, target, discs, world,
        object, motion, contacts, rows):  # fmt: skip
    """`ticks` ticks of `tick` s, each of `substeps` steps.

    Args:
        wound (ticks, K), target (ticks, 7): commands as they arrive at the motors.
        rows (ticks, COLUMNS): filled with what each tick ends with.
    """
    work = work_for(links, wound.shape[1])
    hand = np.zeros(wound.shape[1])
    h = tick / substeps
    for t in range(ticks):
        for _ in range(substeps):
            step(h, links, state, work, straight, hand, wound[t], gravity, servos, mount, joints, target[t], discs,
                 world, object, motion, contacts)  # fmt: skip
        look(links, state, work, mount, joints, motion, rows[t])
