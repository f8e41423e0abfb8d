"""A string by which an object hangs: it only pulls, so an arm may lift the object while it still hangs.

It is a light rod that turns about the hook and slides along itself, towards the hook freely, away from it as far as the
string is long.
"""

import mujoco
import numpy as np

STRING, EYE = "string", "string_eye"  # its body, with a joint each to turn and to slide, and what ties it to the object
MASS, RADIUS = 1e-3, 5e-3  # kg at its lower end, m
# MuJoCo's constraints give way in proportion to 1 - d and to the load over the mass of what they hold, here 1 g.
SOLREF, SOLIMP = (0.01, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)
SHORTEST = 1.0  # m by which the object may rise


def hang(spec: mujoco.MjSpec, object_position: np.ndarray, above: float, length: float) -> None:
    """Hang the body `object`, in place, its centre at `object_position`, m, by a string of `length` m that is tied
    `above` m over it."""
    eye = np.asarray(object_position) + [0.0, 0.0, above]
    body = spec.worldbody.add_body(name=STRING, pos=eye + [0.0, 0.0, length])
    body.add_joint(name=f"{STRING}_turn", type=mujoco.mjtJoint.mjJNT_BALL)
    body.add_joint(name=f"{STRING}_slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, -1], limited=True,
                   range=[-SHORTEST, 0.0], solref_limit=SOLREF, solimp_limit=SOLIMP)  # fmt: skip
    body.explicitinertial, body.mass, body.ipos = True, MASS, [0.0, 0.0, -length]
    body.inertia = np.full(3, MASS * RADIUS**2)
    tie = spec.add_equality(name=EYE, type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_BODY,
                            name1=STRING, name2="object", solref=SOLREF, solimp=SOLIMP)  # fmt: skip
    tie.data[:3] = [0.0, 0.0, -length]
