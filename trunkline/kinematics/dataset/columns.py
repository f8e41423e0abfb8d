"""Names of the columns of the table of samples."""

AXES = "xyz"
DOWN = ["gx", "gy", "gz"]  # the direction of gravity in the base frame, of unit length
POSE = [*AXES, "qw", "qx", "qy", "qz"]  # of the tip: m, and a quaternion


def length_columns(tendons: int) -> list[str]:
    """l1, l2, …"""
    return [f"l{t + 1}" for t in range(tendons)]


def command_columns(tendons: int) -> list[str]:
    """c1, c2, …"""
    return [f"c{t + 1}" for t in range(tendons)]


def tension_columns(tendons: int) -> list[str]:
    """f1, f2, …"""
    return [f"f{t + 1}" for t in range(tendons)]
