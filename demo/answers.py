"""What is true of the plant and of the session: for tests, and for the tables that judge what was identified."""

import mujoco

from demo.instruments import InstrumentSettings, Measurement
from demo.plant import PlantSettings
from demo.truth import Truth
from trunkline.arm.geometry import ChainGeometry
from trunkline.arm.material import unit_properties


def parameters(chain: ChainGeometry, settings: PlantSettings, plant: mujoco.MjModel) -> dict:
    """The plant's counterparts of what is identified, in the units of `trunkline.identification.parameters`.

    `parameters`: by name, null where the plant has none. Stiffness and damping are those of a unit's two joints in
    series, at the base; stiffness with the mean scatter. `forces`: those that motion tells only over the masses.
    `stiffness_factors`: of every unit, on that mean.
    """
    properties = unit_properties(chain, settings.modulus, settings.density, settings.core_ratio, settings.damping_ratio)
    hinges = plant.nv // chain.units  # two joints of two hinges a unit, each joint twice as stiff as the unit
    scatter = plant.jnt_stiffness[::hinges] / 2 / properties.stiffness
    found = {
        "stiffness": scatter.mean() * properties.stiffness[0],
        "hardening": settings.hardening,
        "damping": plant.dof_damping[0] / 2,
        "tendon_friction": plant.tendon_frictionloss[0] if plant.ntendon else None,
        "friction_time": plant.tendon_solref_fri[0, 0] if plant.ntendon else None,
        "kp": settings.cable_stiffness,
        "kv": settings.cable_damping,
        "force_range": settings.max_force,
        "time_constant": None,
    }
    return {
        "parameters": found,
        "forces": ["stiffness", "damping", "tendon_friction", "kp", "kv", "force_range"],
        "mass_factor": settings.mass_factor,
        "stiffness_factors": scatter / scatter.mean(),
    }


def start_in_log(truth: Truth, measured: Measurement, start: float, settings: InstrumentSettings) -> float:
    """When a trial begins, s from the first frame that the cameras delivered.

    Args:
        start: s, of the trial in the session, with which it was measured.
    """
    missing = measured.frames[0] - round(start * settings.frame_rate)
    return truth.begin - missing / settings.frame_rate
