"""What the Panda's joints bear, beside their ranges in `kinematics`."""

import numpy as np

# Franka Control Interface documentation, "Joint limits" of the Panda.
TORQUE_MAX = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # N m
