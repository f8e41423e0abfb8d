"""All raw trials of a session together: which are used, and what only their comparison tells."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.clock_offset import MotorClock, align_clocks, set_gravity_direction
from trunkline.recordings.cleaning.described_arm import Places
from trunkline.recordings.cleaning.pulls import late_commands
from trunkline.recordings.cleaning.resting_shapes import check_resting_shapes
from trunkline.recordings.cleaning.sanity_checks import SanityLimits, check_sanity
from trunkline.recordings.session.session import FixedBase, Session, TrialEntry, some_of
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_stepwise
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.splits import IDENTIFY, SPLITS, TEST, VALIDATE

Refusal = Literal["stop", "leave_out"]
# split: what a session without it cannot have
WITHOUT = {
    IDENTIFY: "nothing can be identified",
    VALIDATE: "no error is of trials that were not fitted",
    TEST: "no error is of trials that nothing was decided on",
}


@dataclass
class CheckedSession:
    """raw_trials, findings: of the trials that are used. refused: reasons, by trial. clock: of the motors."""

    raw_trials: list[RawTrial] = field(default_factory=list)
    findings: list[Findings] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    clock: MotorClock = field(default_factory=MotorClock)


def check_session(
    taken: Iterable[tuple[TrialEntry, RawTrial | InputError, Findings]],
    session: Session,
    plausible: SanityLimits,
    refused_trials: Refusal,
    where: str,
    arm: Places | None = None,
) -> CheckedSession:
    """Compare a session's raw trials, as `load_raw_trials` gives them, and settle what they have in common.

    Args:
        where: the session's folder, for messages.
        arm: the described one, None where nobody describes it.

    Raises:
        InputError: a trial is refused and none may be left out, none is left, or the whole session cannot be true.
    """
    gathered = CheckedSession()

    def refuse(name: str, error: InputError) -> None:
        if refused_trials == "stop":
            raise error
        gathered.refused[name] = str(error)

    for trial, raw, record in taken:
        if isinstance(raw, InputError):
            refuse(trial.name, raw)
        else:
            gathered.raw_trials.append(raw)
            gathered.findings.append(record)
    base = None if isinstance(session.base, FixedBase) else session.base
    raw_trials, findings = gathered.raw_trials, gathered.findings
    session_faults = []
    if raw_trials:
        session_faults = check_sanity(raw_trials, findings, base, plausible, arm, session.frame.unit)
    if plausible.otherwise == "refuse":
        for raw, record in zip(raw_trials, findings, strict=True):
            if record.faults:
                refuse(raw.name, InputError(f"{record.where}: {'; '.join(record.faults)}"))
        if session_faults:
            raise InputError(f"{where}: {'; '.join(session_faults)}")
        used = [not record.faults for record in gathered.findings]
        gathered.raw_trials = [raw for raw, use in zip(gathered.raw_trials, used, strict=True) if use]
        gathered.findings = [record for record, use in zip(gathered.findings, used, strict=True) if use]
    if not gathered.raw_trials:
        first = next(iter(gathered.refused.values()))
        raise InputError(f"{where}: all {len(gathered.refused)} trials refused, the first: {first}")
    missing = _missing(gathered.raw_trials) + _unlisted(session)
    for record in gathered.findings:
        record.warnings += record.faults + session_faults + missing
    set_gravity_direction(gathered.raw_trials, gathered.findings, session)
    gathered.clock = align_clocks(gathered.raw_trials, gathered.findings, plausible.clock)
    for raw, record in zip(gathered.raw_trials, gathered.findings, strict=True):
        record.warnings += late_commands(raw)
    if arm:
        check_resting_shapes(gathered.raw_trials, gathered.findings, arm, base)
    return gathered


def together(sessions: list[CheckedSession]) -> CheckedSession:
    """The raw trials of several sessions of one arm, each with its offset; the clock is that of the least certainty."""
    if len(sessions) == 1:
        return sessions[0]
    raw_trials = [raw for session in sessions for raw in session.raw_trials]
    findings = [record for session in sessions for record in session.findings]
    refused = {name: why for session in sessions for name, why in session.refused.items()}
    clock = max((session.clock for session in sessions), key=lambda clock: clock.uncertainty or 0.0)
    return CheckedSession(raw_trials, findings, refused, clock)


def require_enough(gathered: CheckedSession, planned: list[TrialEntry]) -> None:
    """Refuse what is left of a session that had trials of an experiment in a split, all of which were refused."""
    left = {(raw.experiment, raw.split) for raw in gathered.raw_trials}
    for trial in planned:
        if trial.name in gathered.refused and (trial.experiment, trial.split) not in left:
            expected = f"expected another {trial.experiment} of the split {trial.split} to go on with"
            raise InputError(f"{gathered.refused[trial.name]}; {expected}")


def _unlisted(session: Session) -> list[str]:
    """The logs beside those of the trials, in a sentence."""
    logs = session.unlisted
    if not logs:
        return []
    return [f"logs: {some_of(logs)} in the folder, but in no trial of session.yaml: left out"]


def _missing(raw_trials: list[RawTrial]) -> list[str]:
    """Splits and experiments that the session lacks, and experiments that one of its splits lacks, a sentence each."""
    splits, kinds = ({getattr(raw, key) for raw in raw_trials} for key in ("split", "experiment"))
    done = {(raw.experiment, raw.split) for raw in raw_trials}
    sentences = [f"splits: no trial of the split {split}: {WITHOUT[split]}" for split in SPLITS if split not in splits]
    lacking = [name for name, kind in EXPERIMENTS.items() if name not in kinds and not kind.stepwise]
    if lacking and not any(map(is_stepwise, kinds)):  # an arm that rests throughout needs no other
        remedy = "data/raw/README.md tells which settings do without"
        if len(lacking) == 1 and (way_out := EXPERIMENTS[lacking[0]].without):  # two that are missing need another
            remedy = f"in params.yaml {way_out}: data/raw/README.md"
        sentences.append(f"experiments: no {', '.join(lacking)} in the session: {remedy}")
    return sentences + [
        f"splits: no {experiment} of the split {split}, which the session has"
        for experiment in EXPERIMENTS
        for split in SPLITS
        if experiment in kinds and split in splits and (experiment, split) not in done
    ]
