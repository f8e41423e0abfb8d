"""From a take to a trial: gaps, outliers, noise; one clock, the base frame."""
