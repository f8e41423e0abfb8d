"""Frames of a run as judges see them, made by hand."""

from types import SimpleNamespace

import numpy as np

from rehearsal.experiments.bench import SessionFrame

UNITS, TIP = 6, 4  # of an arm; number from 0 of the first that counts as its tip
FORCE = (0.0, 0.0, 0.01)  # N


def frame(
    now: float = 0.0,
    mode: str = "execute",
    object: dict | None = None,
    world: dict | None = None,
    lies: tuple = (),
    place: tuple = (0.0, 0.0, 0.0),
    units: np.ndarray | None = None,
    **truth,
) -> SessionFrame:
    """object, world: forces on units, by number, N. lies: forces on the object, of each surface. place: the object's,
    m. units: centres (U, 3), m. truth: what else is so."""
    touched, struck = np.zeros((UNITS, 3)), np.zeros((UNITS, 2, 3))
    for number, force in (object or {}).items():
        touched[number] = force
    for number, force in (world or {}).items():
        struck[number, 0] = force
    so = {"hanging": False, "speed": np.zeros(3), "tip": np.zeros(3), **truth}
    so |= {"arm_object": touched, "arm_world": struck, "object_world": np.array(lies or [(0.0, 0.0, 0.0)] * 2)}
    centres = np.zeros((UNITS, 3)) if units is None else units
    return SessionFrame(now, mode, SimpleNamespace(**so), np.array(place), np.zeros(7), np.zeros(3), centres)  # type: ignore[arg-type]
