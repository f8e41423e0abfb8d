"""Connections that ask for nothing: none is kept for long, and there are never many of them.

aiohttp waits without an end for a request that was begun, and for whoever does not read an answer. A connection counts
from when it opened, by TLS from the end of its handshake, or from when it last took some of an answer; what a handler
is busy with, a session's socket above all, does not count.
"""

import asyncio
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import TypeVar

HANDSHAKE = 2.0  # s for that of TLS
LONGEST = 2.5  # s without a request, and without reading an answer, after it; with it and EVERY never more than 5 s
MOST = 128  # of them at a time, beyond which the oldest of the address with the most goes
EVERY = 0.5  # s between looks
Connection = TypeVar("Connection")


def crowding(waiting: Mapping[Connection, Hashable]) -> Connection:
    """Which of those that wait, the oldest first, each with its address, goes where they are too many: the first of the
    address with the most, so that one that floods keeps nobody else out."""
    counts = Counter(waiting.values())
    return max(waiting, key=lambda connection: counts[waiting[connection]])


class IdleConnections:
    """`busy`: those with a request that is handled."""

    def __init__(self) -> None:
        self.busy: set[asyncio.BaseTransport | None] = set()
        self._since: dict[asyncio.Transport, tuple[float, int]] = {}  # s, and bytes of an answer that are left

    def close(self, transports: Iterable[asyncio.Transport | None], now: float) -> int:
        """Close those of the open `transports` that are idle for too long, or too many; how many."""
        idle = [transport for transport in transports if transport is not None and transport not in self.busy]
        self._since = {transport: self._idle_since(transport, now) for transport in idle}
        oldest = sorted(idle, key=lambda transport: self._since[transport][0])
        closed = [transport for transport in oldest if now - self._since[transport][0] >= LONGEST]
        waiting = {transport: _address(transport) for transport in oldest[len(closed) :]}
        while len(waiting) > MOST:
            closed.append(crowding(waiting))
            del waiting[closed[-1]]
        for transport in closed:
            transport.abort()
        return len(closed)

    def _idle_since(self, transport: asyncio.Transport, now: float) -> tuple[float, int]:
        """As `_since` has it: an answer that begins, and each part of it that is read, counts anew."""
        left = transport.get_write_buffer_size()
        since, before = self._since.get(transport, (now, left))
        return (now if left < before or left > before == 0 else since), left

    async def watch(self, transports: Callable[[], Iterable[asyncio.Transport | None]]) -> None:
        """`close`, from time to time, until it is cancelled."""
        while True:
            await asyncio.sleep(EVERY)
            self.close(transports(), asyncio.get_running_loop().time())


def _address(transport: asyncio.Transport) -> Hashable:
    """The other end's, without its port."""
    peer = transport.get_extra_info("peername")
    return peer[0] if peer else None
