"""What all takes of a session have in common, and only together tell: the motors' clock, and the vertical."""

import numpy as np

from trunkline.sessions.session import FixedBase, Session
from trunkline.signals.clock import agree_on_offset
from trunkline.takes.checks import Findings
from trunkline.takes.vertical import check_levels, check_vertical
from trunkline.trials.splits import IDENTIFY
from trunkline.trials.take import Take


def align_clocks(takes: list[Take], findings: list[Findings], disagreement: float) -> tuple[float, float]:
    """Give every take the offset that the session's takes agree on; the offset and its spread, s.

    Only the takes for identification have a say, so that the others stay unseen until they validate; all have,
    where those for identification tell nothing, and then it is said.

    Args:
        disagreement: s, by which the session's two estimates, by the first and by the whole motion, may differ.
    """
    told = [(take, found.offset) for take, found in zip(takes, findings, strict=True) if found.offset is not None]
    chosen = [(take, fit) for take, fit in told if take.split == IDENTIFY]
    offset, spread = agree_on_offset([fit for _, fit in chosen])
    if not np.isfinite(spread) and told:
        chosen = told
        offset, spread = agree_on_offset([fit for _, fit in told])
        if np.isfinite(spread):
            for found in findings:
                said = f"clock: no trial of the split identify tells the motors' offset of {offset:.3f} s"
                found.warnings.append(f"{said}; it is of trials of other splits")
    for take in takes:
        take.clock_offset = offset
    apart = {take.name: fit.offset - fit.onset for take, fit in chosen if fit.certain and fit.onset is not None}
    middle = float(np.median(list(apart.values()) or [0.0]))
    for take, found in zip(takes, findings, strict=True):
        if abs(middle) > disagreement < abs(apart.get(take.name, 0.0)):
            own = apart[take.name]
            said = f"clock: by the whole motion the motors' offset is {own:+.3f} s from the one by the first"
            expected = f"{middle:+.3f} s in the median of {len(apart)} trials, expected at most {disagreement:g} s"
            found.warnings.append(f"{said}, {expected}: does the arm rest before its tendons move?")
    return offset, spread


def settle_vertical(takes: list[Take], findings: list[Findings], session: Session) -> None:
    """Give every take the vertical that its session's tilts prove, and say so; or say what looks wrong."""
    measured_base = not isinstance(session.base, FixedBase)
    up, said, fallback = check_vertical(takes, measured_base)
    for take, found in zip(takes, findings, strict=True):
        if up is not None:
            take.up = up
        if said is not None:
            (found.warnings if up is None else found.repairs).append(said)
        if fallback:
            told = "those of the split identify do not tell"
            found.warnings.append(f"up: the vertical is by the tilts of other splits too, as {told}")
    if measured_base and (up is not None or said is None):
        check_levels(takes, findings)
