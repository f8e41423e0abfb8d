"""Qualisys' QTM as a source of poses, over its real-time protocol: the 6D bodies that it tracks, by name.

In QTM, with a measurement or a preview running: real-time processing of 6DOF on, the bodies' names those of
session.yaml, the real-time server's little-endian port. Poses are in QTM's coordinate system.

Read by Qualisys' library qtm-rt (the extra `qualisys`). Positions are mm, a turn is a matrix column by column, as
public clients read it (vpMocapQualisys of ViSP maps M[i][j] with i first; libraries of Eigen take it as it is), and a
body that is not tracked is NaN. Tested with a server written from the protocol's description; never with QTM.
"""

import asyncio
import struct
import time
import xml.etree.ElementTree as ElementTree
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from trunkline.ar.tracking.stream_checks import StreamLimits
from trunkline.ar.tracking.tracker import CameraFrame, ExpectedBodies
from trunkline.ar.tracking.tracking_process import TrackingProcess
from trunkline.errors import InputError, nearest
from trunkline.frames import wxyz_from_rotation

ANSWERS = 3.0  # s in which the server has to answer each time
MM, MICRO = 1e-3, 1e-6
SQUARE = 1e-2  # by which axes of a turn may differ from right angles and from 1


@dataclass(frozen=True)
class QualisysSettings:
    """server: name or address of the machine that runs QTM. port: of its real-time server, little-endian."""

    server: Annotated[str, Field(min_length=1, max_length=255)] = "127.0.0.1"
    port: Annotated[int, Field(ge=1, le=65_535)] = 22223


class QualisysSource:
    """A `PoseSource`.

    Raises:
        InputError: there is no answer, it cannot be read, or it names no such bodies.
    """

    def __init__(self, settings: QualisysSettings, names: Sequence[str]) -> None:
        where = f"QTM at {settings.server}"
        try:
            import qtm_rt  # with what it needs installed
        except ImportError as error:
            raise InputError(f"{where}: found no qtm_rt, expected the extra `qualisys` to be installed") from error
        self._packets, self._fault, self._came = deque(), "", asyncio.Event()
        self._loop, self._connection = asyncio.new_event_loop(), None
        try:
            self._loop.run_until_complete(asyncio.wait_for(self._begin(qtm_rt, settings, names), 4 * ANSWERS))
        except InputError as error:
            self.close()
            raise InputError(f"{where}: {error}") from error
        except OSError as error:
            self.close()
            reason = f"found no answer at port {settings.port}, expected QTM's real-time server"
            raise InputError(f"{where}: {reason}") from error
        except (ElementTree.ParseError, qtm_rt.QRTCommandException) as error:
            self.close()
            raise InputError(f"{where}: found an answer that is none ({error}), expected its parameters") from error

    def receive(self, seconds: float) -> CameraFrame | None:
        if not self._packets and not self._fault:
            self._loop.run_until_complete(self._wait(seconds))
        if self._packets:
            return self._frame(self._packets.popleft())
        if self._fault:
            time.sleep(seconds)
            raise ValueError(self._fault)
        return None

    def close(self) -> None:
        if self._connection is not None and self._connection.has_transport():
            self._connection.disconnect()
        self._connection = None
        if not self._loop.is_closed():
            self._loop.run_until_complete(asyncio.sleep(0))
            self._loop.close()

    async def _begin(self, qtm_rt, settings: QualisysSettings, names: Sequence[str]) -> None:
        """Connect, look for the bodies, and have frames sent."""
        connection = await asyncio.wait_for(
            qtm_rt.connect(settings.server, settings.port, timeout=ANSWERS, on_disconnect=self._ended), ANSWERS
        )
        if connection is None:  # the library logs why
            raise TimeoutError
        self._connection = connection
        bodies = body_names(await connection.get_parameters(["6d"]))
        for name in names:
            if bodies.count(name) != 1:
                streamed = ", ".join(bodies) or "none"
                raise InputError(f"found the 6D bodies {streamed}, expected {name!r} once{nearest(name, bodies)}")
        self._rows, self._bodies = [bodies.index(name) for name in names], len(bodies)
        try:
            await connection.stream_frames(components=["6d"], on_packet=self._take)
        except TimeoutError as error:
            raise InputError("found no frame, expected a measurement or a preview to run") from error

    async def _wait(self, seconds: float) -> None:
        self._came.clear()
        try:
            await asyncio.wait_for(self._came.wait(), seconds)
        except TimeoutError:
            return

    def _take(self, packet) -> None:
        self._packets.append(packet)
        self._came.set()

    def _ended(self, error: Exception | None) -> None:
        self._fault = f"QTM has ended the connection{f' ({error})' if error else ''}, expected it to last"
        self._came.set()

    def _frame(self, packet) -> CameraFrame:
        try:
            part = packet.get_6d()
        except struct.error as error:
            raise ValueError(f"found a frame of another layout ({error}), expected 6D bodies") from error
        if part is None or len(part[1]) != self._bodies:
            count = "none" if part is None else len(part[1])
            raise ValueError(f"found {count} of the 6D bodies in a frame, expected all {self._bodies}")
        positions = MM * np.array([part[1][row][0] for row in self._rows], float)
        matrices = np.array([part[1][row][1].matrix for row in self._rows], float).reshape(-1, 3, 3)
        tracked = np.asarray(np.isfinite(positions).all(axis=1))
        quaternions = np.full((len(positions), 4), np.nan)
        square = np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))  # NaN is none
        turned = tracked & (square < SQUARE) & (np.linalg.det(np.nan_to_num(matrices)) > 0)
        if turned.any():
            turns = Rotation.from_matrix(matrices[turned].transpose(0, 2, 1))  # column by column
            quaternions[turned] = wxyz_from_rotation(turns)
        stamp = MICRO * packet.timestamp
        return CameraFrame(packet.framenumber, stamp, stamp, tracked, positions, quaternions)


def body_names(parameters: bytes) -> list[str]:
    """Of the 6D bodies, in the order in which frames have them, of QTM's parameters in XML."""
    return [(name.text or "").strip() for name in ElementTree.fromstring(parameters).findall("*/Body/Name")]


class QualisysTracker(TrackingProcess):
    """A `Tracker` of what QTM streams."""

    def __init__(self, settings: QualisysSettings, expected: ExpectedBodies, limits: StreamLimits | None = None):
        super().__init__(partial(QualisysSource, settings), expected, limits)
