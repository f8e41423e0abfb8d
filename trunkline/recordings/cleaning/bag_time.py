"""By how much the motors' clock is off, by when the recorder had what cameras and motors sent: by log times."""

import numpy as np

from trunkline.recordings.cleaning.motors import by_recorder, dated
from trunkline.recordings.cleaning.trial_window import Stretch
from trunkline.recordings.session.session import Session
from trunkline.recordings.session.source import LogSource
from trunkline.recordings.signals.clock import LoggedOffset, offset_by_log_times

COPIED = 10_000  # ns; log times that follow the stamps this closely were copied from them, by whatever wrote the log


def logged_offset(source: LogSource, session: Session, stretch: Stretch) -> LoggedOffset | None:
    """The offset of a trial's motors by log times; None where there are no motors or log times carry nothing."""
    poses, recorder = source.poses, by_recorder(source, session)
    streams = [some for some in (source.commands, source.tendon_positions) if some is not None and len(some.stamps)]
    if not streams:
        return None
    logged = 1e-9 * (poses.log_times[stretch.rows] - stretch.epoch)
    if session.clock == "log":  # both are dated by when the recorder had them
        intervals = np.diff(np.sort(logged))
        return LoggedOffset(0.0, float(np.mean(np.abs(intervals - np.median(intervals)))))
    received = [poses] if recorder else [poses, *streams]
    if any(np.ptp(some.log_times) == 0 or np.ptp(some.log_times - some.stamps) < COPIED for some in received):
        return None
    motor_time = np.concatenate([1e-9 * (dated(some, recorder, stretch) - stretch.epoch) for some in streams])
    motor_logged = np.concatenate([1e-9 * (some.log_times - stretch.epoch) for some in streams])
    return offset_by_log_times(stretch.time, logged, motor_time, motor_logged)
