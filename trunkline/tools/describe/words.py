"""An arm in words: its units, its tendons and what they do, its markers, and what nothing can tell of it."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import parameters_of
from trunkline.model.arm_model import TIP_LOAD, ArmModel
from trunkline.recordings.session.session import Session
from trunkline.recordings.trials.experiments import EXPERIMENTS

WIDEST = 180.0  # deg between neighbouring tendons, from which on they cannot bend the arm to every side
DENSEST = 11_340.0  # kg/m³, lead
ALIKE = 1e-3  # share by which neighbouring units may differ and stand in one line
NARROW, TOGETHER = 2.0, 90.0  # deg, of each joint and of all, below which they bend as if radians were read as degrees


@dataclass(frozen=True)
class Unit:
    """mm, mm, g, N m/rad, deg."""

    length: float
    width: float
    mass: float
    stiffness: float
    bends: float

    def words(self) -> str:
        return (
            f"{self.length:.4g} mm long, {self.width:.4g} mm wide, {self.mass:.4g} g, {self.stiffness:.4g} N m/rad, "
            f"bends by {self.bends:.3g}° to each side"
        )

    def like(self, other: "Unit") -> bool:
        mine, others = (np.array(list(vars(unit).values())) for unit in (self, other))
        return bool(np.all(np.abs(mine - others) <= ALIKE * np.abs(mine)))


def units_of(model: mujoco.MjModel) -> list[Unit]:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies = ArmModel(model).unit_bodies
    places = np.vstack([data.xpos[bodies], data.site("tip").xpos])
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    units = []
    for body, length in zip(bodies, lengths, strict=True):
        joint, geom = model.body_jntadr[body], model.body_geomadr[body]
        width = 2 * model.geom_size[geom][0] if geom >= 0 else np.nan
        bends = np.degrees(model.jnt_range[joint, 1]) if model.jnt_limited[joint] else np.inf
        units.append(Unit(1e3 * length, 1e3 * width, 1e3 * model.body_mass[body], model.jnt_stiffness[joint], bends))
    return units


def load_of(model: mujoco.MjModel) -> float:
    """What hangs at the tip by the description, g; 0 without a load."""
    names = [model.body(index).name for index in range(model.nbody)]
    return 1e3 * float(model.body(TIP_LOAD).mass[0]) if TIP_LOAD in names else 0.0


def unit_lines(model: mujoco.MjModel) -> list[str]:
    """Size and masses, then runs of units that are alike, a line each; where each is another, the first and the last.
    """
    units = units_of(model)
    length, mass, load = sum(unit.length for unit in units), sum(unit.mass for unit in units), load_of(model)
    lines = [f"{len(units)} units, {length:.4g} mm, {mass:.4g} g"]
    if load:
        lines[0] += f" of their own and a load of {load:.4g} g at the tip: {mass + load:.4g} g in all"
    starts = [0, *(k for k in range(1, len(units)) if not units[k].like(units[k - 1])), len(units)]
    runs = list(zip(starts[:-1], starts[1:], strict=True))
    if len(runs) > 8:
        return [*lines, f"  unit 1: {units[0].words()}", f"  unit {len(units)}: {units[-1].words()}"]
    for first, last in runs:
        name = f"unit {last}" if last == first + 1 else f"units {first + 1} to {last}"
        lines.append(f"  {name}: {units[first].words()}")
    return lines


def tendon_lines(model: mujoco.MjModel) -> list[str]:
    """Where each tendon runs, what it does to the arm, and what pulls it."""
    if not model.nu:
        return ["no tendons"]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((model.ntendon, model.nv))
    mujoco.mju_sparse2dense(jacobian, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind)
    arm, bodies = ArmModel(model), _bodies(model)
    lines = [f"{model.nu} tendons"]
    for index, (cable, motor) in enumerate(zip(arm.cables, arm.actuators, strict=True)):
        sites = arm.cable_sites(cable)
        first, last = model.site_pos[sites[0]], model.site_pos[sites[-1]]
        end = bodies.get(model.site_bodyid[sites[-1]], 0)
        arms = np.hypot(*jacobian[cable, : arm.hinge_count].reshape(-1, 2).T)
        crossed = arms[arms > 0]
        apart = [1e3 * np.hypot(*place[:2]) for place in (first, last)]
        away = f"{apart[0]:.3g} mm" if np.isclose(*apart, rtol=ALIKE) else f"{apart[0]:.3g} to {apart[1]:.3g} mm"
        forced = arm.commands == "force"
        holds = "commanded by force," if forced else f"{model.actuator_gainprm[motor, 0]:.4g} N/m"
        facts = [
            f"at {_angle(model, cable):.1f}°", f"{away} from the axis", f"ends at unit {end}",
            f"{1e3 * model.tendon_length0[cable]:.1f} mm long",
            f"{1e3 * np.radians(1) * crossed.sum():.3g} mm for 1° of each joint that it crosses",
            f"{holds} up to {-model.actuator_forcerange[motor, 0]:.4g} N",
        ]  # fmt: skip
        if len(arm.preload) and arm.preload[index]:
            facts.append(f"{arm.preload[index] * model.actuator_gainprm[motor, 0]:.3g} N at command 0")
        lines.append(f"  {arm.cable_names[index]}: {', '.join(facts)}")
    return lines


def marker_lines(model: mujoco.MjModel) -> list[str]:
    """Points of the arm that a session may track, but for the units' centres."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lines = []
    for name in ArmModel(model).markers:
        if not name.startswith("unit_"):
            x, y, z = 1e3 * (data.site(f"{name}_center").xpos - data.site("base_center").xpos)
            aside = f", {np.hypot(x, y):.3g} mm aside" if np.hypot(x, y) > 1e-6 else ""
            lines.append(f"  {name}: {-z:.4g} mm from the mount{aside}")
    return ["tracked points, beside the units' centres:", *lines] if lines else ["tracked points: the units' centres"]


def slips(model: mujoco.MjModel) -> list[str]:
    """What of the description looks like another unit or a slip."""
    return [*_other_angles(model), *_hardly_meant(model)]


def doubt_lines(model: mujoco.MjModel, session: Session | None) -> list[str]:
    """What to know before any log is recorded, or of a session."""
    arm = ArmModel(model)
    lines = slips(model)
    lines.append("masses are as described: no log without a load tells them; weigh the arm")
    angles = np.sort([_angle(model, cable) for cable in arm.cables])
    if len(angles):
        gaps = np.diff(np.append(angles, angles[0] + 360))
        if gaps.max() >= WIDEST:
            towards = (angles[np.argmax(gaps)] + gaps.max() / 2 + 180) % 360 - 180
            lines.append(f"no tendon bends the arm towards {towards:.0f}°: neighbours are {gaps.max():.0f}° apart")
    if session is None:
        return lines
    lines += _unknown(model, session)
    kinds, weightless = {trial.experiment for trial in session.trials}, session.frame.gravity == "none"
    experiments = [EXPERIMENTS[kind] for kind in kinds]
    parameters = parameters_of(model).items()
    unidentifiable = [name for name, each in parameters if not any(map(each.identifiable_from, experiments))]
    if unidentifiable:
        lines.append(f"no trial of the session ({', '.join(sorted(kinds))}) tells {', '.join(unidentifiable)}")
    if weightless and model.nu and arm.commands == "length" and all(EXPERIMENTS[kind].static for kind in kinds):
        lines.append("without gravity and motion, stiffness and kp show in their ratio alone: identify one of them")
    if len(session.markers or {}) == 1:
        lines.append("one tracked point does not tell in which shape the arm is, nor exchanged names of tendons")
    if not weightless and not kinds & {"static_tilt", "static_pull"} and model.nu:
        lines.append("nothing is tilted or held: stiffness comes with the masses and the motors' gain, as a ratio")
    if model.nu and (session.motors or session.tendons) and session.command_unit != arm.command_unit:
        lines.append(f"session.yaml: motors: commands are in {session.command_unit}, the arm takes {arm.command_unit}")
    if arm.commands == "length" and arm.rate_limit == 0 and arm.backlash == 0 and model.nu and "motion" in kinds:
        lines.append("winches are taken to wind as they are told: `rate_limit` and `backlash` of `actuation` are 0")
    return lines


def _unknown(model: mujoco.MjModel, session: Session) -> list[str]:
    """Names that a session gives to what this arm has not, a line a key."""
    arm = ArmModel(model)
    available = {"markers": arm.markers, "tendons": arm.cable_names, "motors": arm.cable_names}
    declared = {
        "markers": (session.markers or {}).values(),
        "tendons": (session.tendons or {}).values(),
        "motors": session.coupling()[0],
    }
    lines = []
    for key, names in declared.items():
        if unknown := [name for name in names if name not in available[key]]:
            has = ", ".join(available[key]) or "none"
            lines.append(f"session.yaml: {key}: found {unknown[0]!r}, the arm has {has}")
    return lines


def _other_angles(model: mujoco.MjModel) -> list[str]:
    """Ranges of joints that look like another unit: radians read as degrees, or degrees read as radians."""
    hinges = range(ArmModel(model).hinge_count)
    bends = np.degrees(np.abs(model.jnt_range[hinges]).max(axis=1))
    together = bends.sum() / 2  # half of the hinges bend the arm to either side
    if model.jnt_limited[hinges].all() and bends.max() < NARROW and together < TOGETHER:
        every = f"no joint bends by more than {bends.max():.2g}°, all together by {together:.3g}°"
        return [f"range: {every}: are ranges in radians, and read as degrees? Expected the unit of compiler.angle"]
    widest = int(bends.argmax())
    if bends[widest] > 360:
        wide = f"{model.joint(widest).name!r} bends by {bends[widest]:.3g}°"
        return [f"range: {wide}: are ranges in degrees, and read as radians? Expected the unit of compiler.angle"]
    return []


def _hardly_meant(model: mujoco.MjModel) -> list[str]:
    """Masses, places and forces that look like another unit or a slip."""
    units, lines = units_of(model), []
    bodies = _bodies(model)
    densities = [unit.mass / (np.pi / 4 * unit.width**2 * unit.length) * 1e6 for unit in units]  # kg/m³
    if dense := [number for number, density in enumerate(densities, start=1) if density > DENSEST]:
        more = f" (and {len(dense) - 1} more)" if len(dense) > 1 else ""
        has = f"has {densities[dense[0] - 1]:.3g} kg/m³, more than lead"
        lines.append(f"unit {dense[0]}{more} {has}: is its mass in kg, its width in m?")
    arm = ArmModel(model)
    preload = arm.preload
    for index, (name, cable, motor) in enumerate(zip(arm.cable_names, arm.cables, arm.actuators, strict=True)):
        for site in arm.cable_sites(cable):
            unit, apart = bodies.get(model.site_bodyid[site], 0), 1e3 * np.hypot(*model.site_pos[site, :2])
            if unit and apart > units[unit - 1].width / 2:
                wide = units[unit - 1].width
                lines.append(f"{name} runs outside unit {unit}, {wide:.3g} mm wide: {apart:.3g} mm from the axis")
                break
        force = preload[index] * model.actuator_gainprm[motor, 0] if len(preload) else 0.0
        if force > -model.actuator_forcerange[motor, 0]:
            strongest = -model.actuator_forcerange[motor, 0]
            lines.append(
                f"{name} is to hold {force:.3g} N at command 0, its motor holds {strongest:.3g} N at most"
            )
    return lines


def _bodies(model: mujoco.MjModel) -> dict[int, int]:
    """The number of the unit, from 1, that each of the arm's bodies is."""
    return {int(body): k for k, body in enumerate(ArmModel(model).unit_bodies, start=1)}


def _angle(model: mujoco.MjModel, cable: int) -> float:
    x, y = model.site_pos[ArmModel(model).cable_sites(cable)[0], :2]
    return float(np.degrees(np.arctan2(y, x)))
