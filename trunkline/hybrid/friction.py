"""Friction coefficients of the printed arm on what it holds, and how contacts are made to hold things.

Polyurethane has no one coefficient: it falls with hardness, from 2 to 3 for the softest grades to about 0.2 for the
hardest (Gallagher Corporation, Polyurethane Design Guide, "Coefficient of friction"; "Polyurethane properties:
Coefficient of friction", rubber-engineering.blogspot.com, May 2011), and is higher on smooth mouldings than on rough
surfaces. Shore 95A is near the hard end. The table holds values of that range, chosen low, in the sources' order of
surfaces, for static friction, dry and clean; nobody has published those of a printed TPU-95A arm on these materials. So
they are the first thing to measure on a robot, and a grasp that needs all of them is not a sure one.
"""

import mujoco

# sliding coefficient, without unit
TPU_ON = {"wood": 0.50, "plastic": 0.45, "paper": 0.40, "fabric": 0.50, "slippery": 0.30}
TORSION = 0.005  # m, torsional coefficient over sliding one: 2/3 of the radius of a contact patch, here 7.5 mm
ROLLING = 1e-4  # m, idle with condim 4
SOLREF = (0.01, 1.0)  # s and damping ratio of contacts: as those of the arm's joint limits
# MuJoCo's friction is a soft constraint: what is held creeps at a rate in proportion to the load on it and to
# (1 - d) / IMPRATIO, d the impedance that SOLIMP ends with. With MuJoCo's own values what is held slides
# away within seconds; tests/hybrid/test_holding.py says how far it may creep with these.
IMPRATIO = 100.0  # friction over normal impedance
SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)
CONDIM = 4  # sliding and torsional friction


def coefficients(material: str) -> tuple[float, float, float]:
    """Sliding, torsional (m) and rolling (m) coefficients on a material of `TPU_ON`."""
    sliding = TPU_ON[material]
    return sliding, sliding * TORSION, ROLLING


def make_holding(spec: mujoco.MjSpec) -> None:
    """Set the options of contacts, in place: elliptic cones, no pass that MuJoCo calls NoSlip.

    They act on contacts alone, not on the friction of joints and tendons: a free arm moves as without them, to the bit.
    """
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = IMPRATIO
    spec.option.noslip_iterations = 0
