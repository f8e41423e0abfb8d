"""Kinematics of the calibrated arm and of the Panda: equilibria sampled, inverted by a network, and mapped."""
