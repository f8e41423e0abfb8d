"""The rigid robot: kinematics, collisions, inverse kinematics, MJCF."""
