"""Friction coefficients of the printed arm on what it holds, and how contacts are made to hold objects.

Polyurethane has no one coefficient: it falls with hardness (Gallagher Corporation, Polyurethane Design Guide,
"Coefficient of friction"). Moulded TPU of Shore 55D begins to slide on smooth steel at 0.42, on coarse steel at 0.33;
one of Shore 80A slides on polished steel at 1.57 (Covestro, "Desmopan: Friction", the first two after DIN EN ISO 8295).
Shore 95A lies between. No values were found for wood, plastic, paper or fabric, nor for printed surfaces: those of the
table are chosen, near the harder grade's, for static friction, dry and clean, and their order is a guess. So they are
the first thing to measure on a robot, and a grasp that needs all of them is not a sure one.
"""

import mujoco

# sliding coefficient, without unit
TPU_ON = {"wood": 0.50, "plastic": 0.45, "paper": 0.40, "fabric": 0.50, "slippery": 0.30}
TORSION = 0.005  # m, torsional coefficient over sliding one: 2/3 of the radius of a contact patch, here 7.5 mm
ROLLING = 1e-4  # m, idle with condim 4
SOLREF = (0.01, 1.0)  # s and damping ratio of contacts: as those of the arm's joint limits
# MuJoCo's friction is a soft constraint: what is held creeps at a rate in proportion to the load on it and to
# (1 - d) / IMPRATIO, d the impedance that SOLIMP ends with. With MuJoCo's own values what is held slides
# away within seconds; tests/ar/hybrid/test_friction.py says how far it may creep with these.
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
