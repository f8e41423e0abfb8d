"""What is to be sent to one client: never more than it takes.

Binary messages are acknowledged by their number. While WINDOW of them are not, none is sent: of the robot's frames and
of the shells the newest waits, of a preview's pieces the next. So a client that stops reading holds WINDOW messages and
no stale motion. JSON is rare; where it does not go out either, the client is gone.
"""

import asyncio
from collections import deque
from dataclasses import dataclass, field

WINDOW = 3  # binary messages that may be unacknowledged
MOST_MESSAGES = 256  # JSON messages that may wait
LATEST = ("robot", "shell")  # of these the newest wins


@dataclass
class Outbox:
    """`sent`, `received`: binary messages so far. `messages`: JSON that waits; `states`: of each kind the newest that
    waits."""

    sent: int = 0
    received: int = 0
    messages: deque[str] = field(default_factory=deque)
    states: dict[str, str] = field(default_factory=dict)
    frames: dict[str, bytes] = field(default_factory=dict)
    pieces: deque[bytes] = field(default_factory=deque)
    ready: asyncio.Event = field(default_factory=asyncio.Event)
    _framed: bool = False

    def say(self, text: str) -> bool:
        """Whether there was room."""
        self.messages.append(text)
        self.ready.set()
        return len(self.messages) <= MOST_MESSAGES

    def state(self, kind: str, text: str) -> None:
        """As `say`, in place of one of this kind that still waits."""
        self.states[kind] = text
        self.ready.set()

    def show(self, kind: str, frame: bytes) -> None:
        """A frame of LATEST."""
        self.frames[kind] = frame
        self._wake()

    def piece(self, message: bytes) -> None:
        """The next piece of a preview."""
        self.pieces.append(message)
        self._wake()

    def forget_pieces(self) -> None:
        """Those of an older preview."""
        self.pieces.clear()

    def acknowledge(self, received: int) -> None:
        """The client has so many; a number that goes back, or beyond what was sent, says nothing."""
        if self.received < received <= self.sent:
            self.received = received
            self._wake()

    @property
    def open(self) -> bool:
        """Whether a binary message may be sent."""
        return self.sent - self.received < WINDOW

    def take(self) -> str | bytes | None:
        """The next to send; None where there is none."""
        if self.messages:
            return self.messages.popleft()
        if self.states:
            return self.states.pop(next(iter(self.states)))
        frame = self._binary() if self.open else None
        if frame is None:
            self.ready.clear()
        else:
            self.sent += 1
        return frame

    def _binary(self) -> bytes | None:
        """A frame and a piece in turns, so that neither waits for the other."""
        kind = next((kind for kind in LATEST if kind in self.frames), None)
        if self.pieces and (kind is None or self._framed):
            self._framed = False
            return self.pieces.popleft()
        self._framed = kind is not None
        return None if kind is None else self.frames.pop(kind)

    def _wake(self) -> None:
        if self.open:
            self.ready.set()
