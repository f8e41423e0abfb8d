"""What a session that cameras recorded says of the twin, beside the truth of the simulated lab.

    python -m qualification.evaluated [PACKAGE] [--plans 10]

The lab's arm on the Panda of the rehearsal, in one session of reaches; cameras see its mount and every fourth unit,
with their noise. Its log becomes a session as a live session's does, and `trunkline evaluate` scores the model of the
tree by it. Then the same log once more, with the bodies where they truly were: what both say differs by the cameras.
Last, the command that `trunkline live` prints identifies from the session, and both score the model that comes of it.
"""

import json
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from demo.plants.stranger_kernel import work_for
from qualification.command import qualify
from rehearsal.experiments.bench import LONGEST, SharedRun, bench_of
from rehearsal.operator.scripts import Script
from rehearsal.robot.kernel import COLUMNS, look
from rehearsal.session import RATE, REFERENCE, RehearsedSession
from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.session.arm_cameras import EVERY, MOUNT, MeasuredArm
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.log_format import LogFormat, Subject
from trunkline.ar.session.log_writer import LogWriter
from trunkline.ar.session.measured_session import LIST, write_session
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Pose
from trunkline.errors import InputError
from trunkline.frames import wxyz_from_rotation
from trunkline.identification.evaluation.error_tables import LABELS
from trunkline.model.arm.mjcf import unit_name
from trunkline.pipeline.config import PROJECT
from trunkline.tools.batch.__main__ import main as batch
from trunkline.tools.evaluate.__main__ import main as evaluate

PLANS, SEED = 10, 52_002
NOISE, ASKEW = 0.3e-3, np.radians(0.3)  # standard deviations per axis, m and rad, of a body's place and turn
RESTS = 20.0  # s after a plan, in which the arm comes to rest
ZERO = 1_700_000_000 * 10**9  # ns
MODEL = Path("artifacts/identify_control/arm.xml")


class LabCameras:
    """Of the arm's mount and units, with noise and without: `true` are the poses (B, 7) of the newest look."""

    def __init__(self, session: RehearsedSession, rng: np.random.Generator) -> None:
        self._session, self._rng = session, rng
        units = len(session.robot.links()[0])
        self._rows = list(range((units - 1) % EVERY, units, EVERY))
        self.names = (MOUNT, *(unit_name(row) for row in self._rows))
        self.pose = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))

    def show(self, bodies: np.ndarray) -> None:
        """Nothing: they see the arm itself."""

    def align(self, pose: Pose) -> None:
        raise AssertionError("their frame is the base's")

    def latest(self) -> MeasuredArm:
        robot, rng = self._session.robot, self._rng
        turn, place = robot.base()
        work = work_for(robot.arm.links, robot.arm.tendons)
        look(robot.arm.links, robot.state, work, robot.mount, robot.joints, robot.motion, np.empty(COLUMNS))
        marked = turn @ robot.arm.mount.inv().as_matrix()  # the axes of the base's marker
        turns = Rotation.from_matrix([marked, *(turn @ work.frames[robot.discs.link[self._rows]])])
        places = np.vstack([place, robot.links()[0][self._rows]])
        self.true = np.hstack([places, wxyz_from_rotation(turns)])
        askew = Rotation.from_rotvec(ASKEW * rng.standard_normal(places.shape))
        places = places + NOISE * rng.standard_normal(places.shape)
        poses = np.hstack([places, wxyz_from_rotation(turns * askew)])
        return MeasuredArm(robot.time, poses, poses[-1, :3], 0.0, RATE, 0.0, "", poses[0, :3])


class TwoLogs(LogWriter):
    """Of one session: as cameras have its bodies, and as these truly are."""

    def __init__(self, folder: Path, subject: Subject, session: RehearsedSession, cameras: LabCameras) -> None:
        super().__init__(subject, lambda: session.robot.time)
        self.paths = [folder / f"{name}.mcap" for name in ("cameras", "truth")]
        self._files = [path.open("wb") for path in self.paths]
        self._formats = [LogFormat(file, subject, ZERO) for file in self._files]
        self._cameras = cameras

    def keep(self, record) -> None:
        for log in self._formats:
            log.write(record)

    def measured(self, stamp: float, poses: np.ndarray) -> None:
        both, self._formats = self._formats, self._formats[:1]
        super().measured(stamp, poses)
        self._formats = both[1:]
        super().measured(stamp, self._cameras.true)
        self._formats = both

    def close(self) -> None:
        self.settle()
        for log, file in zip(self._formats, self._files, strict=True):
            log.finish()
            file.close()


class MeasuredSession:
    """Reaches of the rehearsal's operator, one after the other, before cameras."""

    def __init__(self, bench: SharedRun, folder: Path) -> None:
        rng = np.random.default_rng(SEED)
        self._bench, self._rng, self._place = bench, rng, bench.place(rng)
        operator = bench.operator(rng)
        self.session = session = bench.session(operator, None, SEED, lambda now: self._place)
        cameras = LabCameras(session, rng)
        tendons = tuple(f"tendon_{number + 1}" for number in range(bench.arm.tendons))
        joints = tuple(f"joint_{number}" for number in range(1, 8))
        subject = Subject(("tip",), joints, tendons, bench.package.straight, ("tip", (0.0, 0.0, 0.0)),
                          measured=cameras.names, markers=(None,) * len(cameras.names), mount=MOUNT)  # fmt: skip
        self.log = TwoLogs(folder, subject, session, cameras)
        core = Teleoperation(bench.config.core, bench.package.reach, bench.package.digest, bench.config.mount_offset)
        session.controller = SessionController(
            core, session.executor, session.previewer, session.controller.world, bench.config.handling.least_lift,
            self.log, bench.package.period, cameras, CorrectionSettings(),
        )  # fmt: skip
        session.controller.begin(RATE)
        session.controller.control(REFERENCE)
        self.operator = operator

    def reach(self) -> bool:
        """Whether a plan for another place was executed; then the arm comes to rest."""
        self._place, began = self._bench.place(self._rng), self.session.now
        script: Script = self.operator.reach()
        next(script)
        done = False
        while self.session.now < began + LONGEST:
            try:
                script.send(self.session.frame())
            except StopIteration as end:
                done = bool(getattr(end.value, "done", False))
                break
        until = self.session.now + RESTS
        while self.session.now < until:
            self.session.frame()
        return done


def scored(path: Path, model: Path, folder: Path) -> tuple[pd.DataFrame, set[str]]:
    """Errors of a model by the session of the log at `path`, a row a plan, and the plans to which it was fitted."""
    out = folder / f"evaluated_{path.stem}_{model.parts[-2]}"
    evaluate([str(model), str(path.with_suffix("")), "--settings", str(PROJECT), "--out", str(out)])
    table, metrics = pd.read_csv(out / "trials.csv"), json.loads((out / "metrics.json").read_text())
    table = table[table["model"] == LABELS["model"]].set_index("trial")
    return table, set(metrics["evaluated"]["fitted_to"])


def identified(path: Path, folder: Path) -> Path:
    """The model that comes of the session of the log at `path` by the command that goes with it.

    Raises:
        InputError: a stage has failed.
    """
    name, stage = path.stem, "identify_stiffness"
    if batch([str(path.with_suffix("") / LIST), "--until", stage, "--out", str(folder / "fleet")]):
        raise InputError(f"{name}: found a stage that failed, expected a model of {stage}")
    return folder / "fleet" / name / "artifacts" / stage / "arm.xml"


def measure(package: Path, plans: int) -> None:
    with tempfile.TemporaryDirectory() as name, redirect_stdout(sys.stderr):
        folder = Path(name)
        run = MeasuredSession(bench_of(package), folder)
        done = sum(run.reach() for _ in range(plans))
        run.log.close()
        for path in run.log.paths:
            print("\n".join(write_session(path)))
        tables = [scored(path, MODEL, folder)[0] for path in run.log.paths]
        model = identified(run.log.paths[0], folder)
        by_cameras, fitted = scored(run.log.paths[0], model, folder)
        identified_tables = [by_cameras, scored(run.log.paths[1], model, folder)[0]]
    at_rest = [plan for plan in tables[0].index if plan in tables[1].index]
    unseen = [plan for plan in at_rest if plan not in fitted]
    print(f"| {done} of {plans} plans executed; error at rest, mm, mean | plans | by cameras | by the truth | apart |")
    print("|---|---:|---:|---:|---:|")
    for words, of, chosen in (
        ("the tree's model", tables, at_rest),
        ("the same, of plans that none is identified from", tables, unseen),
        ("the model identified from the others, of the same", identified_tables, unseen),
    ):
        for key, what in (("e_position_mm", "markers"), ("e_tip_mm", "tip")):
            cameras, truth = (table.loc[chosen, key].mean() for table in of)
            print(f"| {words}: {what} | {len(chosen)} | {cameras:.3g} | {truth:.3g} | {abs(cameras - truth):.2g} |")


if __name__ == "__main__":
    sys.exit(qualify("evaluated", __doc__, measure, plans=PLANS))
