"""A link between a server and a client, some of whose packets are late."""

from trunkline.ar.session.clock import PINGS, ClientClock


def clock_error(rng):
    """Of the offset after a round of pings, s: 6 % of packets 20 to 120 ms late, the way up 1 ms slower."""
    clock, now, offset = ClientClock(), 0.0, float(rng.uniform(-1e3, 1e3))
    for n in range(PINGS):
        up, down = rng.exponential(0.002, 2) + 0.002 + [0.001, 0.0]
        up, down = (way + (rng.uniform(0.02, 0.12) if rng.random() < 0.06 else 0.0) for way in (up, down))
        number = clock.ping(now)
        assert clock.pong(number, now + down - offset, now + down + up) == (n == PINGS - 1)
        now += 0.3
    assert clock.offset is not None
    return abs(clock.offset - offset)
