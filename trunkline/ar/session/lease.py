"""Who controls: one does, all watch. The rules, without clock and sockets.

The lease is asked for, released and given away. It ends after LEASE_TIMEOUT s without a sound input, or when its holder
leaves; then the first who asked has it. It never comes back by itself. The stop does not ask for it.
"""

from dataclasses import dataclass, field

LEASE_TIMEOUT = 1.0  # s without a sound input


@dataclass
class ControlLease:
    """`holder`: a client's id, "" for nobody. `asking`: who wants it, in their order. `last_input`: s at which the last
    input came, or the lease began."""

    holder: str = ""
    asking: list[str] = field(default_factory=list)
    last_input: float = 0.0

    def ask(self, client: str, now: float) -> bool:
        """Whether `client` has it now; else it waits."""
        if not self.holder:
            self._take(client, now)
        elif client != self.holder and client not in self.asking:
            self.asking.append(client)
        return client == self.holder

    def give(self, client: str, to: str, now: float) -> bool:
        """Whether `to` has it now; only its holder gives it."""
        if client != self.holder:
            return False
        self._take(to, now)
        return True

    def release(self, client: str, now: float) -> bool:
        """`client` wants it no longer, or has left; whether anything changed."""
        if client in self.asking:
            self.asking.remove(client)
            return True
        if not client or client != self.holder:
            return False
        self._take(self.asking[0] if self.asking else "", now)
        return True

    def hear(self, client: str, now: float) -> bool:
        """Whether an input of `client` counts."""
        if not client or client != self.holder:
            return False
        self.last_input = now
        return True

    def silent(self, now: float) -> bool:
        """Let time pass; whether the lease ended by its holder's silence."""
        if not self.holder or now - self.last_input <= LEASE_TIMEOUT:
            return False
        return self.release(self.holder, now)

    def _take(self, client: str, now: float) -> None:
        self.holder, self.last_input = client, now
        if client in self.asking:
            self.asking.remove(client)
