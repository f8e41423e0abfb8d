"""The offset of a client's clock, by pings: of several, the one with the smallest round trip tells best.

    offset = (sent + received) / 2 - stamp

with `stamp` the client's clock when it answered; it errs by half of what both ways differ. D. L. Mills, "Internet Time
Synchronization: The Network Time Protocol", IEEE Trans. Communications 39 (1991), section III.
"""

from dataclasses import dataclass, field

PINGS = 10  # of a round
EVERY = 10.0  # s between rounds
FORWARD = 0.05  # s by which a stamp may be ahead of now: the offset's own error, generously
LATEST = 0.25  # s that an input may be late, or be on its way there and back: a grip that is let go has to be seen
JUMP = 1.0  # s beyond which nothing was that slow: the clock is another


@dataclass
class ClientClock:
    """server = client + `offset`; None until a round is over. `round_trip`: of the ping that told, s."""

    offset: float | None = None
    round_trip: float = 0.0
    _sent: dict[int, float] = field(default_factory=dict)
    _best: tuple[float, float] | None = None
    _answered: int = 0
    _number: int = 0

    def ping(self, now: float) -> int:
        """Number of a ping that is sent `now`, s. The first of a round forgets what was not answered."""
        if self._number % PINGS == 0:
            self._sent, self._best, self._answered = {}, None, 0
        self._number += 1
        self._sent[self._number] = now
        return self._number

    def pong(self, number: int, stamp: float, now: float) -> bool:
        """Hear the answer; whether the round is over. An answer to what was not asked does nothing."""
        sent = self._sent.pop(number, None)
        if sent is None:
            return False
        trip = now - sent
        if self._best is None or trip < self._best[0]:
            self._best = trip, (sent + now) / 2 - stamp
        self._answered += 1
        if self._answered < PINGS:
            return False
        self.round_trip, self.offset = self._best
        return True

    def fault(self, stamp: float, now: float) -> str:
        """Why an input of this stamp does not count at `now`, "" where it does."""
        if self.offset is None:
            return "input: the clock's offset is not known yet"
        late = now - (stamp + self.offset)
        if late < -FORWARD or late > JUMP:
            why = "has jumped" if abs(late) > JUMP else "runs fast, or has jumped"
            return f"input: its stamp is {abs(late):.3g} s {'old' if late > 0 else 'ahead'}; the clock {why}"
        if late > LATEST:
            return f"input: it comes {late:.2f} s late, expected at most {LATEST:g} s"
        if self.round_trip > LATEST:
            return f"input: there and back takes {self.round_trip:.2f} s, expected at most {LATEST:g} s"
        return ""
