"""Numbers on a clock: smoothing, clocks, units, the base frame."""
