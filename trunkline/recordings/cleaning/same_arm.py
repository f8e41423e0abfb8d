"""Several sessions together: whether they are of one arm, and their raw trials under names that no other has."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.files import file_digest
from trunkline.recordings.cleaning.session_checks import CheckedSession
from trunkline.recordings.cleaning.usual_distances import usual_distances
from trunkline.recordings.logs.bag2 import data_files
from trunkline.recordings.session.session import Session, read_session


def check_each_session(
    folders: dict[str, Path], read: Callable[[Path, Session], CheckedSession], distance: float
) -> dict[str, CheckedSession]:
    """What `read` returns for each of the sessions in `folders`, by name; of several, refused unless of one arm, and
    under names that no other has.

    Args:
        distance: as `require_same_arm` has it.
    """
    sessions = {name: read_session(folder) for name, folder in folders.items()}
    if len(sessions) > 1:
        require_distinct_logs(folders, sessions)
    sessions_read = {name: read(folders[name], session) for name, session in sessions.items()}
    if len(sessions_read) > 1:
        require_same_arm(sessions_read, distance)
        for name, gathered in sessions_read.items():
            name_apart(gathered, name)
    return sessions_read


def name_apart(gathered: CheckedSession, session: str) -> None:
    """Put the session before the names of its raw trials and refused trials: `session/name`, as no session has a / in
    its name."""
    for raw in gathered.raw_trials:
        raw.session, raw.name = session, f"{session}/{raw.name}"
    gathered.refused = {f"{session}/{name}": why for name, why in gathered.refused.items()}


def require_same_arm(sessions: dict[str, CheckedSession], distance: float) -> None:
    """Refuse sessions that cannot be of one arm: other markers, other tendons, or other distances along it.

    Args:
        distance: share of the arm's length by which usual distances from the base may differ.
    """
    (first, reference), *others = sessions.items()
    for name, other in others:
        for key in ("markers", "tendons"):
            ours, theirs = (
                next((list(getattr(t, key)) for t in session.raw_trials if getattr(t, key)), [])
                for session in (reference, other)
            )
            if ours and theirs and ours != theirs:
                problem = f"session {name}: found {key} {_listed(theirs)}, expected those of the session {first}"
                raise InputError(f"{problem}, {_listed(ours)}, as one arm is identified from both")
        ours, theirs = _along(reference), _along(other)
        off = np.abs(ours - theirs)
        if np.nanmax(off) > distance * np.nanmax(ours):
            worst = int(np.nanargmax(off))
            marker = reference.raw_trials[0].markers[worst]
            before = f"{1e3 * ours[worst]:.0f} mm in the session {first}"
            problem = f"session {name}: found {marker!r} {1e3 * theirs[worst]:.0f} mm from the body before it"
            raise InputError(f"{problem}, expected about {before}, as one arm is identified from both")


def require_distinct_logs(folders: dict[str, Path], sessions: dict[str, Session]) -> None:
    """Refuse a log that two sessions hold: it would count twice, and may be fitted here and scored there."""
    first_use: dict[str, tuple[str, str]] = {}
    for name, session in sessions.items():
        for file in sorted({trial.file for trial in session.trials}):
            for part in data_files(folders[name] / file):
                first = first_use.setdefault(file_digest(part), (name, file))
                if first[0] != name:
                    problem = f"session {name}: found {file} with the bytes of {first[1]} of the session {first[0]}"
                    raise InputError(f"{problem}, expected no log in two sessions")


def _along(gathered: CheckedSession) -> np.ndarray:
    """Usual distances of each marker from the body before it, the base before the first, m. Shape (S,)."""
    usual = usual_distances([np.insert(raw.positions, 0, raw.base_positions, axis=1) for raw in gathered.raw_trials])
    return np.diagonal(usual, 1)


def _listed(names: list[str]) -> str:
    return ", ".join(names[:6]) + (", …" if len(names) > 6 else "")
