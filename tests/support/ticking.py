"""A log that is told numbers, so that it shows which of them it has."""

import time

from trunkline.ar.session.log_format import EVENTS
from trunkline.recordings.logs.mcap_log import read_log


def fed(log_writer, seconds, pace=0.01):
    """Times at which something was told, of the journal's clock."""
    times, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        times.append(time.monotonic())
        log_writer.event("tick", number=len(times))
        time.sleep(pace)
    return times


def ticks(path):
    """What is in the file, whatever has become of it: numbers, and what is damaged."""
    log = read_log(path)
    texts = log.topics[EVENTS].messages if EVENTS in log.topics else []
    return [int(text.partition(b'"number":')[2].rstrip(b"}\0")) for text in texts], log.damage
