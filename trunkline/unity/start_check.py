"""Whether the twin starts right in Unity: a finished package's arm through the plug-in's calls, beside the statics."""

from collections.abc import Sequence
from itertools import product

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, gravity_in_base
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated
from trunkline.twin.package import MANIFEST
from trunkline.unity.importer import as_imported
from trunkline.unity.manifest import Manifest, Model
from trunkline.unity.plugin import Imported, Scene
from trunkline.unity.start import TwinComponent
from trunkline.unity.time_steps import steps_taken
from trunkline.unity.upm_package import MODEL

DOWN = np.array([0.0, 0.0, -STANDARD_GRAVITY])
PREFIX = "arm_"  # before an arm's names in the scene
TIP = f"{PREFIX}tip"
WATCHED = 0.5  # s, from a cold start, and after a scene was compiled anew
PULL = 0.03  # m, by which the first tendon is drawn in, and all others are paid out


def turns(tilts: Sequence[float]) -> list[Rotation]:
    """How an arm may hang: its root turned so that gravity comes at these angles, rad, and once from the side."""
    along = [Rotation.align_vectors([DOWN], [gravity_in_base(tilt)])[0] for tilt in tilts]
    return [*along, Rotation.from_euler("x", 60, degrees=True)]


def manifest_of(files: dict[str, bytes]) -> Model:
    """What a package's manifest says of the arm."""
    return Manifest.model_validate_json(files[MANIFEST]).model


def scene_of(files: dict[str, bytes], turn: Rotation, step: float, alone: bool = False) -> Scene:
    """A package's arm, imported and turned, in a scene that has not begun.

    Args:
        step: s. alone: without the component.
    """
    x, y, z, w = turn.as_quat()
    arm = Imported(PREFIX, as_imported(files[MODEL].decode()), (w, x, y, z))
    return Scene([arm], [] if alone else [TwinComponent(manifest_of(files), PREFIX)], DOWN, step)


def at_rest(calibrated: mujoco.MjModel, turn: Rotation, commands: np.ndarray) -> np.ndarray | None:
    """Where the calibrated arm's tip rests by the statics, its root turned, m (3,); None where no equilibrium is known.

    Args:
        calibrated: takes commands. commands: m. Shape (K,).
    """
    data = mujoco.MjData(calibrated)
    mujoco.mj_kinematics(calibrated, data)
    base = data.body("base")
    to_root = base.xmat.reshape(3, 3)
    gravity = to_root.T @ turn.inv().apply(DOWN)
    rest = actuated(read_chain(calibrated).smooth, commands[None], gravity[None])
    return turn.apply(base.xpos + to_root @ rest.position[0]) if rest.converged[0] else None


def started(calibrated: mujoco.MjModel, files: dict[str, bytes], tilts: Sequence[float]) -> dict[str, dict[str, float]]:
    """How right the twin starts, as metrics: `start_error_mm` and `recreated_error_mm`, each the `max` over gravity
    from so many sides (`turns`: those at which the arm's equilibrium is known) and all steps that are taken, and what
    it is `without` the component.

    Args:
        calibrated: takes commands. files: of the finished package. tilts: gravity angles, rad.
    """
    rest = np.array([actuator.rest_length for actuator in manifest_of(files).actuators])
    rests = [(turn, at_rest(calibrated, turn, rest)) for turn in turns(tilts)]
    equilibria = [(turn, tip) for turn, tip in rests if tip is not None]
    if not equilibria:
        raise InputError("the twin's start: found no equilibrium of the calibrated arm, expected one to start from")
    names = ("start_error_mm", "recreated_error_mm")
    metrics: dict[str, dict[str, float]] = {name: {"turns": len(equilibria)} for name in names}
    for key, alone in (("max", False), ("without", True)):
        start, recreated = 0.0, 0.0
        for (turn, tip), step in product(equilibria, steps_taken()):
            scenes = [scene_of(files, turn, step, alone) for _ in range(3)]
            start = max(start, start_error(scenes[0], tip))
            recreated = max(recreated, recreated_error(scenes[1], scenes[2]))
        metrics["start_error_mm"][key] = round(1e3 * start, 6)
        metrics["recreated_error_mm"][key] = round(1e3 * recreated, 6)
    return metrics


def start_error(scene: Scene, rest: np.ndarray) -> float:
    """How far the tip is from `rest` (3,) after a cold start with nobody sending anything, m: after the first step or
    after `WATCHED`, whichever is more."""
    scene.start()
    furthest = 0.0
    for count in (1, round(WATCHED / scene.step) - 1):
        scene.fixed_update(count)
        furthest = max(furthest, float(np.linalg.norm(scene.site(TIP) - rest)))
    return furthest


def recreated_error(scene: Scene, other: Scene) -> float:
    """How far the tip gets in `WATCHED` after a scene was compiled anew from where it is in another that was not, m:
    of an arm that is pulled and still swings."""
    for instance in (scene, other):
        instance.start()
        pull(instance)
        instance.fixed_update(round(WATCHED / instance.step))
    scene.recreate()
    furthest = 0.0
    for _ in range(round(WATCHED / scene.step)):
        scene.fixed_update()
        other.fixed_update()
        furthest = max(furthest, float(np.linalg.norm(scene.site(TIP) - other.site(TIP))))
    return furthest


def pull(scene: Scene) -> None:
    """Draw the first tendon in by `PULL`, and pay all others out as much."""
    names = [scene.model.actuator(number).name for number in range(scene.model.nu)]
    scene.controls |= {name: -PULL if number else PULL for number, name in enumerate(names)}
