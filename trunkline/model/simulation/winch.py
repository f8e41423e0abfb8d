"""Winches that wind at a limited rate, and with backlash: lengths that are commanded in, those that are delivered out.

MJCF knows neither for a motor on a tendon, so commands u are shaped before MuJoCo sees them; its dead time and lag come
after that. With rate limit r, backlash b and step h, a drum v and what it leaves of cable w follow

    v_t = v_{t-1} + clip(u_t - v_{t-1}, -r h, r h)
    w_t = clip(w_{t-1}, v_t - b/2, v_t + b/2)

The latter is the play operator (M. A. Krasnosel'skii, A. V. Pokrovskii, Systems with Hysteresis, 1989).
"""

import numpy as np
from mujoco.batch import Batch

from trunkline.model.arm_model import BACKLASH, RATE_LIMIT, ArmModel


class Winches:
    """Those of `batch`'s simulations, which have stood at the lengths `held` (B, K), m, for long: their cables in the
    middle of the play. Each simulation has the model's numbers, or its own."""

    def __init__(self, batch: Batch, lengths: np.ndarray) -> None:
        self._batch = batch
        self._drums, self._cables = (np.array(lengths, dtype=float) for _ in range(2))
        rate, self._play = (_numbers(batch, name) for name in (RATE_LIMIT, BACKLASH))
        self._rate = np.where(rate > 0, rate, np.inf)
        self.idle = not (rate.any() or self._play.any())

    def deliver(self, commands: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """What the simulations `ids` (n,) get in the next T steps for `commands`, m. Both of shape (n, T, K)."""
        if self.idle:
            return commands
        timesteps = self._batch.expanded("opt.timestep")
        step = self._batch.model.opt.timestep if timesteps is None else timesteps[ids]
        drums, cables = self._drums[ids], self._cables[ids]
        delivered = wind(commands, drums, cables, self._rate[ids] * step, self._play[ids])
        self._drums[ids], self._cables[ids] = drums, cables
        return delivered


def _numbers(batch: Batch, name: str) -> np.ndarray:
    """What each simulation has for the number of this name, 0 where the model has none. Shape (B,)."""
    values, places = batch.expanded("numeric_data"), ArmModel(batch.model).places(name)
    if values is None or not len(places):
        return np.full(batch.nsim, ArmModel(batch.model).number(name))
    return values[:, places[0]].copy()


def wind(
    commands: np.ndarray, drums: np.ndarray, cables: np.ndarray, furthest: np.ndarray, play: np.ndarray
) -> np.ndarray:
    """What n candidates deliver of `commands` (n, T, K), m, in the same shape.

    Args:
        drums, cables: where they are before, m, changed in place. Shape (n, K). furthest: of a drum in a step, m.
            Shape (n,). play: m. Shape (n,).
    """
    furthest, half = furthest[:, None], play[:, None] / 2
    delivered = np.empty(commands.shape)
    for step in range(commands.shape[1]):
        drums += np.clip(commands[:, step] - drums, -furthest, furthest)
        cables[:] = delivered[:, step] = np.clip(cables, drums - half, drums + half)
    return delivered
