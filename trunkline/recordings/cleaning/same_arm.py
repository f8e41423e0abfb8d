"""Several sessions together: whether they are of one arm, and their takes under names that no other has."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.files import file_digest
from trunkline.recordings.cleaning.label_swaps import usual_distances
from trunkline.recordings.cleaning.session_checks import Gathered
from trunkline.recordings.session.session import Session, read_session


def gather_each(
    folders: dict[str, Path], take: Callable[[Path, Session], Gathered], distance: float
) -> dict[str, Gathered]:
    """What `take` gathers of each of the sessions in `folders`, by name; of several, refused unless of one arm, and
    under names that no other has.

    Args:
        distance: as `require_one_arm` has it.
    """
    sessions = {name: read_session(folder) for name, folder in folders.items()}
    if len(sessions) > 1:
        require_own_logs(folders, sessions)
    found = {name: take(folders[name], session) for name, session in sessions.items()}
    if len(found) > 1:
        require_one_arm(found, distance)
        for name, gathered in found.items():
            name_apart(gathered, name)
    return found


def name_apart(gathered: Gathered, session: str) -> None:
    """Say of all takes, and of refused trials, to which session they belong: `session/name`, as no session has a / in
    its name."""
    for take in gathered.takes:
        take.session, take.name = session, f"{session}/{take.name}"
    gathered.refused = {f"{session}/{name}": why for name, why in gathered.refused.items()}


def require_one_arm(sessions: dict[str, Gathered], distance: float) -> None:
    """Refuse sessions that cannot be of one arm: other segments, other tendons, or other distances along it.

    Args:
        distance: share of the arm's length by which usual distances from the base may differ.
    """
    (first, one), *others = sessions.items()
    for name, other in others:
        for key in ("segments", "tendons"):
            ours, theirs = (next((list(getattr(t, key)) for t in g.takes if getattr(t, key)), []) for g in (one, other))
            if ours and theirs and ours != theirs:
                found = f"session {name}: found {key} {_shown(theirs)}, expected those of the session {first}"
                raise InputError(f"{found}, {_shown(ours)}, as one arm is identified from both")
        ours, theirs = _along(one), _along(other)
        off = np.abs(ours - theirs)
        if np.nanmax(off) > distance * np.nanmax(ours):
            worst = int(np.nanargmax(off))
            segment, before = one.takes[0].segments[worst], f"{1e3 * ours[worst]:.0f} mm in the session {first}"
            found = f"session {name}: found {segment!r} {1e3 * theirs[worst]:.0f} mm from the body before it"
            raise InputError(f"{found}, expected about {before}, as one arm is identified from both")


def require_own_logs(folders: dict[str, Path], sessions: dict[str, Session]) -> None:
    """Refuse a log that two sessions hold: it would count twice, and may be fitted here and scored there."""
    seen: dict[str, tuple[str, str]] = {}
    for name, session in sessions.items():
        for file in sorted({trial.file for trial in session.trials}):
            first = seen.setdefault(file_digest(folders[name] / file), (name, file))
            if first[0] != name:
                found = f"session {name}: found {file} with the bytes of {first[1]} of the session {first[0]}"
                raise InputError(f"{found}, expected no log in two sessions")


def _along(gathered: Gathered) -> np.ndarray:
    """Usual distances of each segment from the body before it, the base before the first, m. Shape (S,)."""
    usual = usual_distances([np.insert(take.positions, 0, take.base_positions, axis=1) for take in gathered.takes])
    return np.diagonal(usual, 1)


def _shown(names: list[str]) -> str:
    return ", ".join(names[:6]) + (", …" if len(names) > 6 else "")
