"""What needs no process: alignment by touches and the clock's offset, simulated, and the page as it is served."""

import gzip

import numpy as np

from benchmarks.acceptance.row import Row, p95
from tests.support.links import clock_error
from tests.support.touches import PLACES, TRUE, at_reach, directions, observed
from trunkline.ar.session.alignment import fit, in_base, inverse, suspect
from trunkline.ar.session.auth import HEADERS
from trunkline.ar.session.session import PAGE

TRIALS, SIGMA, OFF = 2000, 1e-3, 0.01  # m along each axis, of touches; m by which one is wrong


def rows() -> list[Row]:
    return [*aligned(), clock(), *page()]


def aligned() -> list[Row]:
    rng, off, named, others, alarms = np.random.default_rng(0), [], 0, 0, 0
    for trial in range(TRIALS):
        touched, point = observed(PLACES, rng, SIGMA), at_reach(rng)
        there = in_base(fit(touched, PLACES), in_base(inverse(TRUE), point))
        off.append(np.linalg.norm(there - point))
        alarms += suspect(touched, PLACES) is not None
        bad = trial % len(PLACES)
        touched[bad] += OFF * directions(1, rng)[0]
        found = suspect(touched, PLACES)
        named += found is not None and found.index == bad
        others += found is not None and found.index != bad
    told = f"{len(PLACES)} places, touches of {1e3 * SIGMA:g} mm, {TRIALS} trials"
    shares = [f"{100 * count / TRIALS:.2f} %" for count in (named, others, alarms)]
    return [
        Row(f"alignment, {told}: error at 0.9 m, p95", f"{1e3 * p95(np.array(off)):.2f} mm", "≤ 3 mm"),
        Row(f"… one touch {1e3 * OFF:g} mm off is named", f"{shares[0]} (another one: {shares[1]})", "named"),
        Row("… one is named where none is off", shares[2], "none"),
    ]


def clock() -> Row:
    rng = np.random.default_rng(0)
    errors = 1e3 * np.array([clock_error(rng) for _ in range(TRIALS)])
    what = "clock's error, 6 % of packets 20 to 120 ms late, way up 1 ms slower, p95"
    return Row(what, f"{p95(errors):.2f} ms", "≤ 2 ms")


def page() -> list[Row]:
    size = sum(len(gzip.compress(file.read_bytes())) for file in sorted(PAGE.iterdir()))
    words = [word for word in HEADERS["Content-Security-Policy"].split() if "unsafe-" in word]
    return [
        Row("page, gzipped", f"{size / 1e3:.0f} kB", "≤ 250 kB"),
        Row("… `unsafe-*` in its Content-Security-Policy", ", ".join(words) or "0", "0"),
    ]
