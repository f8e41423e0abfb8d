"""Continuation: equilibria followed from one that is known while the loads grow, as compiled kernels."""

from typing import NamedTuple

import numpy as np

from trunkline.model.statics.energy import Pull
from trunkline.model.statics.kernel import kernel
from trunkline.model.statics.newton import find_equilibrium, new_work
from trunkline.model.statics.vectors import copy

BRANCH_STEP = 1.0  # rad: a corrector that moves a joint further than its whole range has left the branch
SLACK = 1e3  # m, a length that no arm's tendon has: it does not pull
MIN_SHARE = 1 / 4096  # smallest step of the continuation, as a share of the load


class EquilibriumRows(NamedTuple):
    """What the kernels write, a row an equilibrium: as in `equilibria.Equilibrium`, but for the tip the frame of the
    last unit, its rotation (B, 3, 3) and its joint's position (B, 3) in the base frame, m."""

    qpos: np.ndarray
    rotation: np.ndarray
    position: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray
    snapped: np.ndarray


@kernel
def solve_paths(
    first, last, chain, all_tensions, all_lengths, gravities, slope, ceiling, torques, all_loose, cables, rows
):  # fmt: skip
    """Paths `first` to `last` (not included) into `found`: weight first, then the pulls one after the other."""
    steps, tendons = all_tensions.shape[1:]
    for path in range(first, last):
        gravity, torque, loose = gravities[path], torques[path], all_loose[path]
        work = new_work(chain.mass.shape[0], tendons)
        q = chain.rest.copy().reshape(-1)
        slack = Pull(np.zeros(tendons), slope, np.full(tendons, SLACK), ceiling, torque, 0.0, loose)
        here = Pull(np.zeros(tendons), slope, np.zeros(tendons), ceiling, torque, chain.capstan, loose)
        loss, total, good, jumped = _follow(chain, q, np.zeros(3), gravity, slack, slack, cables, work)
        copy(work.state.lengths, here.length)
        if cables:
            spare = 0.0
            for t in range(tendons):
                spare = max(spare, here.length[t] - all_lengths[path, 0, t])
            for t in range(tendons):
                here.length[t] = all_lengths[path, 0, t] + spare
        for step in range(steps):
            tension, length = all_tensions[path, step].copy(), all_lengths[path, step].copy()
            goal = Pull(tension, slope, length, ceiling, torque, chain.capstan, loose)
            if good:
                loss, more, good, snap = _follow(chain, q, gravity, gravity, here, goal, cables, work)
                total += more
                jumped = jumped or snap
                copy(goal.tension, here.tension)
                copy(goal.length, here.length)
            row = path * steps + step
            copy(q, rows.qpos[row])
            record(rows, row, work.state, loss, total, good)
            rows.snapped[row] = jumped
            total = 0


@kernel
def record(rows, row, state, residual, iterations, converged):
    """Write what is known of one equilibrium beside its joint angles into its row."""
    for k in range(3):
        copy(state.rotation[-1, k], rows.rotation[row, k])
    copy(state.position[-1], rows.position[row])
    copy(state.lengths, rows.lengths[row])
    copy(state.tensions, rows.tensions[row])
    rows.residual[row] = residual
    rows.iterations[row] = iterations
    rows.converged[row] = converged


@kernel
def _follow(chain, q, start_gravity, gravity, start, pull, cables, work):
    """Move the loads from (start_gravity, start) to (gravity, pull) in straight lines, the equilibrium with them.

    The step is halved whenever Newton fails or leaves the branch, and doubled when it does not. `q` goes from the
    equilibrium at the first loads to that at the last, `pull.tension` of cables to their tensions.

    Returns (residual, iterations, converged, snapped): snapped where the branch ended (a fold) and the arm jumped.
    """
    tendons = pull.tension.shape[0]
    tension, length = start.tension.copy(), start.length.copy()
    now = Pull(tension, pull.slope, length, pull.ceiling, pull.torque, pull.friction, pull.loose)
    begin, accepted = now.tension.copy(), q.copy()
    loads = start_gravity.copy()
    done, share, total, snapped, residual = 0.0, 1.0, 0, False, 0.0
    while done < 1:
        share = min(share, 1 - done)
        target = 1.0 if share >= 1 - done else done + share
        for k in range(3):
            loads[k] = start_gravity[k] + target * (gravity[k] - start_gravity[k])
        for t in range(tendons):
            begin[t] = now.tension[t]
            if not cables:
                now.tension[t] = start.tension[t] + target * (pull.tension[t] - start.tension[t])
            now.length[t] = start.length[t] + target * (pull.length[t] - start.length[t])
        residual, stretch, iterations, converged = find_equilibrium(chain, q, loads, now, cables, work)
        total += iterations
        moved = 0.0
        for j in range(q.shape[0]):
            moved = max(moved, abs(q[j] - accepted[j]))
        if not converged or moved > BRANCH_STEP:
            if share > MIN_SHARE:
                copy(accepted, q)
                copy(begin, now.tension)
                share *= 0.5 if converged else 0.25
                continue
            if not converged:
                return residual, total, False, snapped
            snapped = True
        copy(q, accepted)
        done = target
        share *= 2
    if cables:
        copy(now.tension, pull.tension)
    return residual, total, True, snapped
