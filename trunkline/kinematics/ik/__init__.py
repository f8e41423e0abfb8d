"""Inverse kinematics: samples of equilibria, the network that inverts them, its score and its file."""
