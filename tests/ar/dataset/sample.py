"""The log of a made-up live session: a plan that is done, one that is stopped, a grasp that fails, and following."""

from dataclasses import replace

import numpy as np

from tests.ar.session.written import JOINTS, TENDONS, Written
from tests.ar.teleop.test_plan import START, STRAIGHT
from tests.support.operator import PACKAGE, Operator
from trunkline.ar.session.log_format import SIMULATED, Subject
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop.messages import (
    ExecutorReport,
    Intent,
    PlanReport,
    Request,
    Target,
    Targets,
    World,
    WorldObject,
)

RATE, LAG = 120.0, 0.02  # Hz, of steps; s by which what is measured is later than what is sent
PLACE = (0.0, 0.0, -0.1)  # m, of the tip in the arm's last body
SUBJECT = Subject(("base", "unit_01"), JOINTS, TENDONS, STRAIGHT, ("unit_01", PLACE))
CUP = WorldObject("cup", "cylinder", 0.05, 0.1, 0.1, (0.7, 0.1, 0.2))


def targets(x: float, object: str = "") -> Targets:
    return Targets(Target((x, 0.1, 0.5)), Target((x, 0.1, 0.1)), (0.0, 0.0, -1.0), 0.25, 0, 0.0, object=object)


def sent(at: float) -> tuple[np.ndarray, np.ndarray]:
    """Joints, rad, and pulls, m, as sent at a time of the log."""
    return START + 0.1 * np.sin(at), np.array([0.02 + 0.01 * np.sin(at), 0.0, 0.01 * at / 100])


class Session(Written):
    """By a clock that its steps move on."""

    def __init__(self, path, measured: bool, names=TENDONS, hardware: str = SIMULATED):
        super().__init__(path, replace(SUBJECT, tendons=names, hardware=hardware))
        self.time, self.measured, self.world = 100.0, measured, World("w", (), (CUP,))
        message = Operator().message
        self.message = replace(message, world=self.world)
        tip = {"body": "unit_01", "place": PLACE}
        self.event("begin", package=PACKAGE, hardware=hardware, mount_offset=0.1, tip=tip)
        self.event("world", world=self.world)

    def pass_by(self, seconds: float, mode: str, motion: str = "hold", **wanted) -> None:
        """Steps of the core in one mode; `aim` (Targets) moves by 0.1 m/s along x where it is followed."""
        for _ in range(round(seconds * RATE)):
            (joints, pulls), (lag_joints, lag_pulls) = sent(self.time), sent(self.time - LAG)
            nothing = np.full(7, np.nan)
            pose = np.array([[0.0, 0, 0, 1, 0, 0, 0], [0.1 * self.time, 0, 0, 0, 1, 0, 0]])  # turned by 180° about x
            measured = lag_joints if self.measured else None
            wound = STRAIGHT - lag_pulls if self.measured else None
            self.robot_state(RobotState(self.time, 0.0, joints, STRAIGHT - pulls, nothing, pose, measured, wound))
            fields = {"targets": None, "rays": ((0.1, 0.2, self.time), None)} | wanted
            if motion == "follow":
                fields["follow"] = targets(0.1 * self.time)
            self.step(1 / RATE, self.message, Intent(mode, motion, "", **fields))
            self.time += 1 / RATE

    def plan(self, serial: int, wanted: Targets, probability: float | None = None) -> str:
        """Aimed at, asked for, previewed, confirmed and begun."""
        digest = f"{serial:x}" * 64
        self.pass_by(0.5, "aim", targets=wanted)
        request = Request(serial, wanted, "w", PACKAGE)
        self.event("request", request=request)
        self.event("planned", report=PlanReport(serial, digest))
        self.event("preview", preview={"digest": digest, "step": 0.02})
        self.event("foreseen", foreseen={"digest": digest, "probability": probability, "spread": []})
        self.pass_by(0.2, "plan", targets=wanted, request=request)
        for mode in ("preview", "ready", "delay"):
            self.pass_by(0.1, mode, targets=wanted, preview=digest)
        self.event("execute", digest=digest, refused="")
        self.event("robot", robot=ExecutorReport("running", digest))
        return digest


def write_session(path, measured: bool = True, names=TENDONS, hardware: str = SIMULATED) -> None:
    session = Session(path, measured, names, hardware)
    moved = targets(0.9)  # where the hands went meanwhile: not what is executed
    session.pass_by(0.5, "hold")
    digest = session.plan(1, targets(0.5))
    session.pass_by(2.0, "execute", "execute", execute=digest, targets=moved)
    session.event("robot", robot=ExecutorReport("done", digest))
    digest = session.plan(2, targets(0.6))
    session.pass_by(1.0, "execute", "execute", execute=digest, targets=moved)
    session.event("robot", robot=ExecutorReport("idle", digest))
    session.pass_by(0.3, "stopped")
    digest = session.plan(3, targets(0.7, "cup"), 0.9)
    session.pass_by(1.0, "execute", "execute", execute=digest, targets=moved)
    session.event("robot", robot=ExecutorReport("done", digest))
    session.pass_by(0.3, "aim", targets=moved)
    session.pass_by(1.5, "follow", "follow", targets=targets(0.8))
    session.pass_by(0.3, "hold")
    session.close()
