"""What all takes of a session have in common, and only together tell: the motors' clock, and the vertical."""

import numpy as np

from trunkline.sessions.session import FixedBase, Session
from trunkline.signals.clock import OffsetFit, agree_on_offset
from trunkline.takes.checks import Findings
from trunkline.takes.vertical import check_vertical
from trunkline.trials.splits import IDENTIFY
from trunkline.trials.take import Take


def align_clocks(takes: list[Take], fits: list[OffsetFit | None]) -> tuple[float, float]:
    """Give every take the offset that the session's takes agree on; the offset and its spread, s.

    Only the takes for identification have a say, so that the others stay unseen until they validate; all have,
    where those for identification tell nothing.
    """
    told = [(take.split, fit) for take, fit in zip(takes, fits, strict=True) if fit is not None]
    offset, spread = agree_on_offset([fit for split, fit in told if split == IDENTIFY])
    if not np.isfinite(spread):
        offset, spread = agree_on_offset([fit for _, fit in told])
    for take in takes:
        take.clock_offset = offset
    return offset, spread


def settle_vertical(takes: list[Take], findings: list[Findings], session: Session) -> None:
    """Give every take the vertical that its session's tilts prove, and say so; or say what looks wrong."""
    up, said = check_vertical(takes, measured_base=not isinstance(session.base, FixedBase))
    for take, found in zip(takes, findings, strict=True):
        if up is not None:
            take.up = up
        if said is not None:
            (found.warnings if up is None else found.repairs).append(said)
