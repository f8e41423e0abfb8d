"""What all logs of a session together say of their bodies: which there are, in which unit, how far apart."""

from dataclasses import dataclass, field

import numpy as np

from trunkline.recordings.cleaning.checks import deciding
from trunkline.recordings.cleaning.described_arm import Places, fits, size_ratio, unit_that_fits
from trunkline.recordings.cleaning.trial_window import Stretch
from trunkline.recordings.cleaning.usual_distances import usual_distances
from trunkline.recordings.logs.messages import UNLABELLED
from trunkline.recordings.session.session import FixedBase, Session, TrialEntry, some_of
from trunkline.recordings.session.source import LogSource
from trunkline.recordings.signals.units import METRES_PER, extent, likely_unit, other_units

FARTHEST = 1e6  # m or mm; no camera sees farther, and squares of what is farther overflow at last


@dataclass
class Reference:
    """What each trial is read and repaired by.

    markers: name in the log to name in the model, in the order of every raw trial. base: the body that marks the mount,
    None where none does. scale: m per unit of the logs' positions.
    distances: between the base and the markers, see `usual_distances`; None where there is too little to compare.
    joint_topics: of all logs. repairs, warnings: what is to be said of every trial; see `Findings`.
    """

    markers: dict[str, str]
    base: str | None
    scale: float
    distances: np.ndarray | None
    joint_topics: tuple[str, ...]
    repairs: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def bodies(self) -> list[str]:
        """Names in the log of the bodies that a trial needs: the base, where one marks it, then the markers."""
        return list(self.markers) if self.base is None else [self.base, *self.markers]


def reference_of(
    session: Session, trials: list[tuple[TrialEntry, LogSource, Stretch]], arm: Places | None = None
) -> Reference:
    """Compare the logs of a session: the trials of the split `identify`, or all where none of those can be read.

    Another unit than the declared one is taken where it alone makes bodies as far apart as on the described arm; of an
    arm that is not described, or not with these markers, where the declared one is that of no arm.
    """
    base = None if isinstance(session.base, FixedBase) else session.base
    markers, sources = session.markers, [source for _, source, _ in trials]
    lost: list[str] = []
    if markers is None:
        mount = session.base.body if isinstance(session.base, FixedBase) else session.base
        names = {name for source in sources for name in source.poses.names if name != mount}
        unlabelled = {name for name in names if UNLABELLED.fullmatch(name)}
        markers = {name: name for name in sorted(names - unlabelled or names)}
        lost = sorted(names - set(markers))
    joint_topics = tuple(sorted({name for source in sources for name in source.joint_topics}))
    reference = Reference(markers, base, METRES_PER[session.frame.unit], None, joint_topics)
    if lost:
        reference.repairs.append(f"{some_of(lost)} left out: they are markers without a label")
    bodies = reference.bodies
    complete = [some for some in trials if set(bodies) <= set(some[1].poses.names)]
    chosen, fallback = deciding(complete, lambda some: some[0].split)
    if fallback:
        consequence = "the unit and the usual distances between bodies are of trials of other splits"
        reference.warnings.append(f"no trial of the split identify can be read: {consequence}")
    logs = [
        source.poses.positions[np.ix_(stretch.rows, np.array([source.poses.names.index(name) for name in bodies], int))]
        for _, source, stretch in chosen
    ]
    logs = [np.where(np.abs(positions) < FARTHEST, positions, np.nan) for positions in logs]
    declared = session.frame.unit
    unit = _unit(session, logs, list(markers.values()), arm)
    if unit != declared:
        apart = np.median([extent(positions) for positions in logs])
        reference.scale = METRES_PER[unit]
        problem = f"bodies {apart:.4g} apart are no arm in {declared}, as declared"
        reference.repairs.append(f"unit: {problem}; taken as {unit}")
    elif arm is None and declared == "m" and likely_unit(logs) not in ("m", None):
        reference.warnings.append(f"unit: bodies are no arm in m, as declared: {other_units(logs, declared)}?")
    if logs and len(bodies) >= 3:
        reference.distances = usual_distances(_with_mount(logs, session, reference.scale))
    return reference


def _unit(session: Session, logs: list[np.ndarray], markers: list[str], arm: Places | None) -> str:
    """The unit of the bodies' positions in `logs` (T, B, 3): the declared one, or another that is proven."""
    declared, lone = session.frame.unit, len(markers) == 1
    if not logs:
        return declared
    ratios = {}
    for unit, metres in METRES_PER.items():
        ratios[unit] = size_ratio(usual_distances(_with_mount(logs, session, metres)), markers, arm or {})
    if np.isnan(ratios[declared]):
        likely = likely_unit(logs)
        return likely if {likely, declared} == {"m", "mm"} and likely is not None else declared
    return declared if fits(ratios[declared], lone) else unit_that_fits(ratios, lone) or declared


def _with_mount(logs: list[np.ndarray], session: Session, metres: float) -> list[np.ndarray]:
    """The base and the markers, m, (T, 1 + S, 3), of logs in a unit of so many metres."""
    logs = [metres * positions for positions in logs]
    if isinstance(session.base, FixedBase):
        logs = [np.insert(positions, 0, np.array(session.base.position), axis=1) for positions in logs]
    return logs
