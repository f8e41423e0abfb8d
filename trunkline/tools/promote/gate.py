"""The replay gate: why a new twin must not take the place of an old one."""

import math

REPLAYED = ("e_position_mm", "e_tip_mm")
FACTOR = 1.1  # times as bad a replay of a kind of trial may become; a choice, between the gate's 1.3 and none


def against(session: str, old: dict, new: dict, better: bool) -> list[str]:
    """Reasons against the new twin by one session, a line each; none where it passes.

    Args:
        session: its name, which begins each line.
        old, new: what `evaluate` gives of each twin on the session's trials that neither was fitted to.
        better: whether the new one must be better over all, as on the session that it comes from.
    """
    reasons, kinds = [], sorted(old["model"]["by_experiment"].keys() | new["model"]["by_experiment"].keys())
    for kind in kinds:
        before, now, noise = (
            table["by_experiment"].get(kind, {}) for table in (old["model"], new["model"], new["noise_floor"])
        )
        for error in REPLAYED:
            if error in before or error in now:  # else nobody saw the tip
                was, value = before.get(error, math.nan), now.get(error, math.nan)
                most = max(FACTOR * was, was + noise.get(error, 0.0))
                if not value <= most:  # NaN is no pass
                    reasons.append(f"{session}: {kind}: {error}: found {value:.3g}, expected at most {most:.3g}, "
                                   f"as the old twin has {was:.3g}")  # fmt: skip
    was, value = (metrics["model"]["e_position_mm"] for metrics in (old, new))
    if better and not value < was:
        reasons.append(f"{session}: e_position_mm: found {value:.3g}, expected less than the old twin's {was:.3g}")
    return reasons
