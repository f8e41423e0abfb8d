"""Whether the tip as cameras see it rests, and where."""

from collections import deque

import numpy as np

WINDOW = 1.0  # s that are looked at: more than one swing of an arm at 1.3 Hz
BLOCK = 0.1  # s whose mean counts as one position: a sample scatters by the cameras' noise
STILL = 0.8e-3  # m across all that the blocks' means move


class RestWatch:
    """Looks at the tip sample by sample."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, np.ndarray]] = deque()

    def observe(self, time: float, tip: np.ndarray) -> bool:
        """A sample at `time`, s, (3,) m; NaN where no camera saw it. Whether the tip has been at rest for WINDOW s."""
        self._samples.append((time, tip))
        while time - self._samples[0][0] > WINDOW:
            self._samples.popleft()
        if time - self._samples[0][0] < WINDOW - BLOCK:
            return False
        times, tips = np.array([at for at, _ in self._samples]), np.array([tip for _, tip in self._samples])
        blocks = ((time - times) // BLOCK).astype(int)
        visible = np.isfinite(tips).all(axis=1)
        means = [tips[visible & (blocks == block)].mean(axis=0) for block in np.unique(blocks[visible])]
        return len(means) >= 0.8 * WINDOW / BLOCK and bool(np.ptp(means, axis=0).max() <= STILL)

    @property
    def tip(self) -> np.ndarray:
        """The mean over WINDOW s, m. Shape (3,)."""
        return np.nanmean([tip for _, tip in self._samples], axis=0)
