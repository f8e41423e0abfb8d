"""The Panda as its maker's URDF has it, for checks of `trunkline.kinematics.panda` that share nothing with it.

Numbers of `franka_description/robots/panda_arm.xacro` and `robots/panda/joint_limits.yaml` of franka_ros: joint origins
(xyz in m, roll about x in units of a quarter turn; the others are 0), limits, self-collision capsules as published, all
of them. Pairs of links: those that the maker's MoveIt configuration leaves to be checked.
"""

import mujoco
import numpy as np

# xyz (m), roll (quarter turns), lowest and highest angle (rad)
JOINTS = [
    ((0.0, 0.0, 0.333), 0, -2.8973, 2.8973),
    ((0.0, 0.0, 0.0), -1, -1.7628, 1.7628),
    ((0.0, -0.316, 0.0), 1, -2.8973, 2.8973),
    ((0.0825, 0.0, 0.0), 1, -3.0718, -0.0698),
    ((-0.0825, 0.384, 0.0), -1, -2.8973, 2.8973),
    ((0.0, 0.0, 0.0), 1, -0.0175, 3.7525),
    ((0.088, 0.0, 0.0), 1, -2.8973, 2.8973),
]
LINK_8 = 0.107  # m along z, the flange
# link: centre (m), axis, radius (m), length between the centres of the caps (m); those of no pair are left out
CAPSULES = {
    0: [((-0.075, 0.0, 0.06), "x", 0.06, 0.03)],
    1: [((0.0, 0.0, -0.1915), "z", 0.06, 0.283)],
    2: [((0.0, 0.0, 0.0), "z", 0.06, 0.12)],
    5: [((0.0, 0.0, -0.26), "z", 0.06, 0.10), ((0.0, 0.08, -0.13), "z", 0.025, 0.14)],
    6: [((0.0, 0.0, -0.03), "z", 0.05, 0.08)],
    7: [((0.0, 0.0, 0.01), "z", 0.04, 0.14), ((0.06, 0.0, 0.082), "x", 0.03, 0.01)],
}
PAIRS = [(0, 5), (0, 6), (0, 7), (1, 5), (1, 6), (1, 7), (2, 5), (2, 7)]
QUATERNIONS = {"x": "0.7071067811865476 0 0.7071067811865476 0", "z": "1 0 0 0"}  # of a capsule's axis


def panda(mount_offset: float) -> mujoco.MjModel:
    """Hinges `joint1` to `joint7`, site `mount`, `mount_offset` m beyond the flange; contacts of the pairs alone."""
    opening = ""
    for number, (xyz, roll, low, high) in enumerate(JOINTS, start=1):
        opening += f"""
            <body name="link{number}" pos="{_row(xyz)}" euler="{roll * np.pi / 2!r} 0 0">
              <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
              <joint name="joint{number}" axis="0 0 1" range="{low} {high}"/>{_geoms(number)}"""
    pairs = "".join(
        f'<pair geom1="link{a}_{i}" geom2="link{b}_{j}"/>'
        for a, b in PAIRS for i in range(len(CAPSULES[a])) for j in range(len(CAPSULES[b]))
    )  # fmt: skip
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco model="franka_panda">
          <compiler angle="radian" eulerseq="XYZ" autolimits="true"/>
          <default><geom contype="0" conaffinity="0"/></default>
          <worldbody>{_geoms(0)}{opening}
            <site name="mount" pos="0 0 {LINK_8 + mount_offset!r}"/>{"</body>" * len(JOINTS)}
          </worldbody>
          <contact>{pairs}</contact>
        </mujoco>""")


def _geoms(link: int) -> str:
    return "".join(
        f'<geom name="link{link}_{i}" type="capsule" pos="{_row(centre)}" quat="{QUATERNIONS[axis]}" '
        f'size="{radius} {length / 2!r}"/>'
        for i, (centre, axis, radius, length) in enumerate(CAPSULES.get(link, []))
    )


def _row(values: tuple[float, ...]) -> str:
    return " ".join(str(value) for value in values)
