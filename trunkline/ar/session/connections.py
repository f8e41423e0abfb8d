"""Connections that ask for nothing: none is kept for long, and there are never many of them.

aiohttp waits without an end for a request that was begun. A connection counts from when it opened, or from its last
answer; what a handler is busy with, a session's socket above all, does not count.
"""

import asyncio
from collections.abc import Callable, Iterable

LONGEST = 5.0  # s without a request, a TLS handshake included
MOST = 128  # of them at a time, beyond which the oldest goes
EVERY = 0.5  # s between looks


class IdleConnections:
    """`busy`: those with a request that is handled."""

    def __init__(self) -> None:
        self.busy: set[asyncio.BaseTransport | None] = set()
        self._since: dict[asyncio.Transport, float] = {}

    def close(self, transports: Iterable[asyncio.Transport | None], now: float) -> int:
        """Close those of the open `transports` that are idle for too long, or too many; how many."""
        idle = [t for t in transports if t is not None and t not in self.busy and not t.get_write_buffer_size()]
        self._since = {transport: self._since.get(transport, now) for transport in idle}
        late = [transport for transport in idle if now - self._since[transport] >= LONGEST]
        rest = sorted(set(idle) - set(late), key=lambda transport: self._since[transport])
        closed = late + rest[: max(len(rest) - MOST, 0)]
        for transport in closed:
            transport.abort()
        return len(closed)

    async def watch(self, transports: Callable[[], Iterable[asyncio.Transport | None]]) -> None:
        """`close`, from time to time, until it is cancelled."""
        while True:
            await asyncio.sleep(EVERY)
            self.close(transports(), asyncio.get_running_loop().time())
