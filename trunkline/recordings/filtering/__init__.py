"""From a raw trial to a trial: gaps, outliers, noise; one clock, the base frame."""
