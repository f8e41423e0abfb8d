"""The stranger's links as bodies of MuJoCo, to compare its engine with."""

import mujoco

from demo.plants.stranger_kernel import Links


def add_link(body: mujoco.MjsBody, links: Links, i: int):
    """Link `i` below `body`, the link above it or the base: its mass, its two hinges and their linear springs.

    Returns:
        The new body, its frame at the hinges.
    """
    body = body.add_body(pos=[0, 0, -links.lengths[i - 1] if i else 0.0])
    body.explicitinertial, body.mass, body.ipos = True, links.masses[i], [0, 0, -links.lengths[i] / 2]
    body.inertia = [links.transverse[i], links.transverse[i], links.axial[i]]
    for k, axis in enumerate(([1, 0, 0], [0, 1, 0])):
        joint = body.add_joint(name=f"{i}_{k}", axis=axis, springref=links.rest[i, k])
        joint.stiffness = [links.stiffness[i], 0, 0]
    return body
