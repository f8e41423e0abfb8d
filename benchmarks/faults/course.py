"""What is done to a session as its robot moves, and what comes of it."""

import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.faults.hushed import HUSH
from benchmarks.faults.operator import JUMP, PATIENCE
from benchmarks.faults.scene import Scene, staged
from trunkline.ar.session.log_reader import read_session_log
from trunkline.errors import InputError

MOVING = 0.4  # s for which the robot has moved before anything is done
HANG = 0.5  # s
AWAY = 0.6  # s after which who controls comes back, of the 1 s after which it controls no more
STILL = 0.15  # s without motion: it rests
NEVER = 3.0  # s without a hold: it was told none
WHY = ("mode", "robot", "refused")  # events that say it
WITHIN = 1.0  # s of the fault


@dataclass(frozen=True)
class Fault:
    """`do` it, and `mend` it: who controls is there again, and holds its grips. Without that, it ends its session.
    motors: on a session that has some."""

    title: str
    do: Callable[[Scene], None]
    mend: Callable[[Scene], None] | None = None
    motors: bool = False


@dataclass
class Suffered:
    """Of a `fault` that was `done` at that time, s: s until the robot was told to hold, until it rested; whether it
    moved again when who controls was back, None where nobody comes back; and what was said."""

    fault: Fault
    done: float
    held: float
    rested: float
    resumed: bool | None = None
    said: str = ""


def _tell(word: str) -> Callable[[Scene], None]:
    return lambda scene: scene.operator.tell(word)


def _kill(which: str) -> Callable[[Scene], None]:
    return lambda scene: os.kill(getattr(scene.told, which), signal.SIGKILL)


def _hang(scene: Scene) -> None:
    scene.signal(signal.SIGSTOP)
    time.sleep(HANG)
    scene.signal(signal.SIGCONT)


def _go_on(scene: Scene) -> None:
    scene.operator.tell("grip")
    scene.operator.signal(signal.SIGCONT)


FAULTS = (
    Fault("grip released", _tell("release"), _tell("grip")),
    Fault("socket closed", _tell("close"), Scene.renew),
    Fault("client killed", lambda s: s.operator.signal(signal.SIGKILL), Scene.renew),
    Fault("client silent", lambda s: s.operator.signal(signal.SIGSTOP), _go_on),
    Fault("both controllers lost", _tell("lose"), _tell("grip")),
    Fault(f"client's clock jumps by {JUMP:g} s", _tell("jump"), Scene.renew),
    Fault("poses are no numbers", _tell("nan"), _tell("grip")),
    Fault(f"server hangs for {HANG:g} s", _hang, _tell("grip")),
    Fault("server killed -9", lambda s: s.signal(signal.SIGKILL)),
    Fault("log's process killed", _kill("journal")),
    Fault("robot's process killed", _kill("robot")),
    Fault(f"a motor silent for {1e3 * HUSH:g} ms", lambda s: s.witness.hush(), motors=True),
    Fault("machine's process killed, with motors", _kill("robot"), motors=True),
    Fault("motors' process hangs", lambda s: os.kill(s.witness.motors, signal.SIGSTOP), motors=True),
    Fault("motors' process killed", lambda s: os.kill(s.witness.motors, signal.SIGKILL), motors=True),
)


def suffered(fault: Fault, scene: Scene) -> Suffered:
    """
    Raises:
        InputError: the robot never came to move, or did not rest, or nobody came back.
    """
    witness = scene.witness
    _wait_for_motion(fault, scene)
    done = time.monotonic()
    fault.do(scene)
    while (now := time.monotonic()) - max(witness.moved, done) < STILL or (witness.held < done and now - done < NEVER):
        if now - done > PATIENCE:
            raise InputError(f"{fault.title}: found a robot that still moves after {PATIENCE:g} s")
        time.sleep(0.002)
    rested = witness.moved
    found = Suffered(fault, done, witness.held - done if witness.held > done else np.inf, max(rested - done, 0.0))
    if fault.mend is not None:
        time.sleep(max(done + AWAY - time.monotonic(), 0.0))
        begun = witness.begun
        fault.mend(scene)
        scene.operator.gripped()
        found.resumed = witness.moved > rested or witness.begun > begun
        scene.operator.tell("")
    return found


def _wait_for_motion(fault: Fault, scene: Scene) -> None:
    now = began = time.monotonic()
    since = None
    while since is None or now - since < MOVING:
        time.sleep(0.002)
        now = time.monotonic()  # after any sleep, which may be long: what is looked at next is no older
        since = (since or now) if scene.witness.running else None
        if now - began > PATIENCE:
            raise InputError(f"{fault.title}: found no motion within {PATIENCE:g} s")
    scene.listen()


def session(package: Path, faults: list[Fault]) -> list[Suffered]:
    """Of each fault in turn, in one session: no more than the last of them ends it."""
    found = []
    with staged(package, faults[-1].motors) as scene:
        for fault in faults:
            found.append(suffered(fault, scene))
            print(f"{fault.title}: {1e3 * found[-1].held:.0f} ms", file=sys.stderr, flush=True)
        time.sleep(WITHIN)
    events = [event for event in read_session_log(scene.told.log).events if event["event"] in WHY]
    for one in found:
        at, why = _why(one.done, events)
        one.said = why or _line(one.done, scene.lines) or "(nobody is left to say it)"
        if np.isinf(one.held) and why:  # its own process notes nothing any more
            one.held = at - one.done
    return found


def _why(done: float, events: list[dict]) -> tuple[float, str]:
    """The first reason that the log gives after `done`, and when."""
    for event in events:
        if done < event["time"] < done + WITHIN:
            words = {"mode": "notice", "refused": "reason"}.get(event["event"])
            found = event[words] if words else event["robot"]["fault"]
            if found:
                return event["time"], f"{found} (log)"
    return np.inf, ""


def _line(done: float, lines: list[tuple[float, str]]) -> str:
    return next((f"{line} (server)" for at, line in lines if done < at < done + WITHIN), "")
