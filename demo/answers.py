"""What is true of the session: for tests, and for the tables that judge what was identified."""

from demo.instruments import InstrumentSettings, Measurement
from demo.truth import Truth


def start_in_log(truth: Truth, measured: Measurement, start: float, settings: InstrumentSettings) -> float:
    """When a trial begins, s from the first frame that the cameras delivered.

    Args:
        start: s, of the trial in the session, with which it was measured.
    """
    missing = measured.frames[0] - round(start * settings.frame_rate)
    return truth.begin - missing / settings.frame_rate
