"""The data set: equilibria of the calibrated arm, sampled evenly over its workspace."""
