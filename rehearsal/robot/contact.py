"""The force between two bodies that touch at a point: Hunt and Crossley's along the normal, a bristle across it.

    N = max(0, k δ^(3/2) (1 + c δ̇)),    T = -(k_t ξ + c_t v),    |T| ≤ μ N

δ: depth, m. v: sliding velocity, m/s. ξ: bristle, m, which follows ξ̇ = v and slips where T is at its bound. So what
is held stays where it is: at rest nothing creeps, unlike with friction that grows with velocity.

Sources: K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, 1975, with
Hertz's exponent; P. A. Cundall and O. D. L. Strack, A discrete numerical model for granular assemblies, 1979.
"""

import numpy as np

from rehearsal.robot.compiled import kernel
from trunkline.model.statics.vectors import dot, plus


@kernel
def touch(h, depth, normal, velocity, bristle, hardness, loss, stiffness, damping, friction):
    """Force on a body, and its bristle after a step of h s. All vectors are tuples in one frame.

    Args:
        normal: unit vector, towards this body. velocity: of this body's point against the other's, m/s.
        hardness: k, N/m^1.5. loss: c, s/m. stiffness: k_t, N/m. damping: c_t, N s/m. friction: μ.
    """
    leaving = dot(velocity, normal)
    load = max(hardness * depth * np.sqrt(depth) * (1 - loss * leaving), 0.0)
    sliding = plus(velocity, -leaving, normal)
    bristle = plus(plus(bristle, -dot(bristle, normal), normal), h, sliding)
    across = plus((-stiffness * bristle[0], -stiffness * bristle[1], -stiffness * bristle[2]), -damping, sliding)
    size, bound = np.sqrt(dot(across, across)), friction * load
    if size > bound:
        across = (across[0] * bound / size, across[1] * bound / size, across[2] * bound / size)
        bristle = (-across[0] / stiffness, -across[1] / stiffness, -across[2] / stiffness)
    return plus(across, load, normal), bristle
