"""What goes wrong in a live session as its robot moves: until the robot is told to hold, until it rests, and why.

    python -m qualification.faults [PACKAGE] [--times 5]

What does not concern the motion must not end it: then the plan goes on to its end, and so does the session.

The session is the real one on the simulated robot: server, log, planning and robot are processes of their own, and so
is the client that controls. It goes through aim, preview, confirmation and execution; as the robot moves, something is
done to one of them. Times are noted by the robot's own process, of its axes as they are sent, on one clock; where that
process is what is killed, by the session's log. The reason is read from that log. Then whoever controls is back, holds
its grips for 1 s and confirms nothing: does the robot go on by itself?

A motor is silent in a session whose Panda and motors are simulated, the latter behind their real driver.
"""

import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from qualification.command import qualify
from qualification.hushed import HUSH
from qualification.operator import DRIFTS, JUMP, LATE, PATIENCE
from qualification.scene import OperatedSession, staged
from trunkline.ar.session.clock import FORWARD
from trunkline.ar.session.controller import MOST_UNDRAWN
from trunkline.ar.session.follow import PLANNER_TIMEOUT
from trunkline.ar.session.log_reader import read_session_log
from trunkline.ar.session.log_writer import LATE as LOG_LATE
from trunkline.ar.session.robot_process import DEAD_MAN
from trunkline.ar.session.settings import read_session_config
from trunkline.errors import InputError

GOAL = 0.15  # s
MOVING = 0.4  # s for which the robot has moved before anything is done
HANG = 0.5  # s
STALL = 0.8 * LOG_LATE  # s; it may begin just before the log is written
AWAY = 0.6  # s after which who controls comes back, of the 1 s after which it controls no more
STILL = 0.15  # s without motion: it rests
NEVER = 3.0  # s without a hold: it was told none
WHY = ("mode", "robot", "refused")  # events that say it
WITHIN = 1.0  # s of the fault, or of when it counts
NOBODY, GOES_ON = "(nobody is left to say it)", "(nothing: the plan goes on to its end)"


@dataclass(frozen=True)
class Fault:
    """`do` it, and `mend` it: who controls is there again, and holds its grips. Without that, it ends its session.
    motors: on a session that has some. word: told to who controls, from the beginning. allowed: s for which it may go
    on before it counts; None where it does not concern the motion."""

    title: str
    do: Callable[[OperatedSession], None]
    mend: Callable[[OperatedSession], None] | None = None
    motors: bool = False
    word: str = ""
    allowed: float | None = 0.0


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


def _tell(word: str) -> Callable[[OperatedSession], None]:
    return lambda scene: scene.operator.tell(word)


def _kill(which: str) -> Callable[[OperatedSession], None]:
    return lambda scene: os.kill(getattr(scene.told, which), signal.SIGKILL)


def _stop(which: str) -> Callable[[OperatedSession], None]:
    return lambda scene: os.kill(getattr(scene.told, which), signal.SIGSTOP)


def _resume(which: str) -> Callable[[OperatedSession], None]:
    def resume(scene: OperatedSession) -> None:
        os.kill(getattr(scene.told, which), signal.SIGCONT)
        scene.operator.tell("grip")

    return resume


def _stall(scene: OperatedSession) -> None:
    os.kill(scene.told.journal, signal.SIGSTOP)
    time.sleep(STALL)
    os.kill(scene.told.journal, signal.SIGCONT)


def _hang(scene: OperatedSession) -> None:
    scene.signal(signal.SIGSTOP)
    time.sleep(HANG)
    scene.signal(signal.SIGCONT)


def _go_on(scene: OperatedSession) -> None:
    scene.operator.tell("grip")
    scene.operator.signal(signal.SIGCONT)


SILENT = read_session_config().journal.period + LOG_LATE  # s
FAULTS = (
    Fault("grip released", _tell("release"), _tell("grip")),
    Fault("socket closed", _tell("close"), OperatedSession.renew),
    Fault("client killed", lambda s: s.operator.signal(signal.SIGKILL), OperatedSession.renew),
    Fault("client silent", lambda s: s.operator.signal(signal.SIGSTOP), _go_on),
    Fault("both controllers lost", _tell("lose"), _tell("grip")),
    Fault(f"client's clock jumps by {JUMP:g} s", _tell("jump"), OperatedSession.renew),
    Fault(f"client's clock runs {DRIFTS['drift']:.0%} fast", _tell("drift"), OperatedSession.renew,
          allowed=FORWARD / DRIFTS["drift"]),
    Fault(f"client's clock runs {1e6 * DRIFTS['slew']:.0f} ppm fast", _tell("slew"), _tell("grip"), allowed=None),
    Fault(f"inputs are evenly {LATE:g} s late", _tell("late"), OperatedSession.renew),
    Fault(f"nothing drawn, inputs go on ({MOST_UNDRAWN:g} s allowed)", _tell("blind"), _tell("grip"),
          allowed=MOST_UNDRAWN),
    Fault("poses are no numbers", _tell("nan"), _tell("grip")),
    Fault(f"server hangs for {HANG:g} s", _hang, _tell("grip")),
    Fault("process that plans hangs", _stop("planner"), _resume("planner"), allowed=None),
    Fault(f"the same, as it follows ({PLANNER_TIMEOUT:g} s allowed)", _stop("planner"), _resume("planner"),
          word="follow", allowed=PLANNER_TIMEOUT),
    Fault(f"log's process hangs for {STALL:g} s", _stall, _tell("grip"), allowed=None),
    Fault(f"log's process hangs ({SILENT:g} s allowed)", _stop("journal"), _resume("journal"), allowed=SILENT),
    Fault("server killed -9", lambda s: s.signal(signal.SIGKILL)),
    Fault("log's process killed", _kill("journal")),
    Fault("robot's process killed", _kill("robot")),
    Fault(f"a motor silent for {1e3 * HUSH:g} ms", lambda s: s.witness.signal_motors(signal.SIGUSR1), motors=True),
    Fault("machine's process killed, with motors", _kill("robot"), motors=True),
    Fault("motors' process hangs", lambda s: s.witness.signal_motors(signal.SIGSTOP), motors=True),
    Fault("motors' process killed", lambda s: s.witness.signal_motors(signal.SIGKILL), motors=True),
)


def suffered(fault: Fault, scene: OperatedSession) -> Suffered:
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


def _wait_for_motion(fault: Fault, scene: OperatedSession) -> None:
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
    with staged(package, faults[-1].motors, faults[-1].word) as scene:
        for fault in faults:
            found.append(suffered(fault, scene))
            print(f"{fault.title}: {1e3 * found[-1].held:.0f} ms", file=sys.stderr, flush=True)
        time.sleep(WITHIN)
    events = [event for event in read_session_log(scene.told.log).events if event["event"] in WHY]
    for one in found:
        within = WITHIN + (one.fault.allowed or 0.0)
        at, why = _why(one.done, within, events)
        if one.fault.allowed is None and np.isinf(one.held):
            one.said = GOES_ON
            continue
        one.said = why or _line(one.done, within, scene.lines) or NOBODY
        if np.isinf(one.held) and why:  # its own process notes nothing any more
            one.held = at - one.done
    return found


def _why(done: float, within: float, events: list[dict]) -> tuple[float, str]:
    """The first reason that the log gives `within` so many s after `done`, and when."""
    for event in events:
        if done < event["time"] < done + within:
            words = {"mode": "notice", "refused": "reason"}.get(event["event"])
            found = event[words] if words else event["robot"]["fault"]
            if found:
                return event["time"], f"{found} (log)"
    return np.inf, ""


def _line(done: float, within: float, lines: list[tuple[float, str]]) -> str:
    return next((f"{line} (server)" for at, line in lines if done < at < done + within), "")


def main(package: Path, times: int) -> None:
    """Faults that are mended share a session, with the first that is not; each other one has its own."""
    mended = [fault for fault in FAULTS if fault.mend is not None and not fault.word] * times
    first, *others = [fault for fault in FAULTS if fault.mend is None or fault.word] * times
    found: dict[str, list[Suffered]] = {fault.title: [] for fault in FAULTS}
    for faults in ([*mended, first], *([fault] for fault in others)):
        for one in session(package, faults):
            found[one.fault.title].append(one)
    print("| as the robot moves | times | told to hold after, ms: median | most | rests after, ms: most"
          " | went on by itself | said |")  # fmt: skip
    print("|---|---:|---:|---:|---:|---:|---|")
    for title, rows in found.items():
        print(f"| {title} | {told(rows)} | {rows[0].said} |")
    late = [one.held - one.fault.allowed for rows in found.values() for one in rows if one.fault.allowed is not None]
    print(f"\nGoal: {1e3 * GOAL:.0f} ms once it counts; found at most {1e3 * max(late):.0f} ms. The robot itself brakes"
          f" after {1e3 * DEAD_MAN:.0f} ms without a permit.")  # fmt: skip


def told(rows: list[Suffered]) -> str:
    held, rested = (1e3 * np.array([getattr(one, what) for one in rows]) for what in ("held", "rested"))
    resumed = [one.resumed for one in rows if one.resumed is not None]
    again = str(sum(resumed)) if resumed else "nobody comes back"
    median, most = (f"{value:.0f}" if np.isfinite(value) else "not told" for value in (np.median(held), held.max()))
    return f"{len(rows)} | {median} | {most} | {rested.max():.0f} | {again}"


if __name__ == "__main__":
    sys.exit(qualify("faults", __doc__, main, times=5))
