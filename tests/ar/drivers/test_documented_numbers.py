"""The figures of docs/hardware.md are those of the code: each is read from its sentence and compared with what the
code has, and none is left out."""

import re
from functools import cache
from pathlib import Path

import pytest

from trunkline.ar.drivers import (
    driver,
    driver_client,
    gm6020,
    hardware_robot,
    local_driver_process,
    motors,
    ros_panda,
    setpoint_filter,
    simulated_motors,
    time_scaling,
    watchdog,
    winch,
)
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.ar.drivers.winch import WinchSettings
from trunkline.ar.session import (
    auth,
    client,
    clock,
    controller,
    correction_control,
    follow,
    hardware_process,
    lease,
    log_writer,
    robot_process,
    server,
)
from trunkline.ar.session.settings import SessionConfig as Live
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.ar.teleop.executor import BRAKE
from trunkline.ar.tracking import stream_checks
from trunkline.kinematics.panda.limits import ACCELERATION, VELOCITY
from trunkline.pipeline.config import PROJECT, load_folder

ROOT = Path(__file__).parents[3]
PAGE = "docs/hardware.md"
SET, TELEOP = load_folder(ExecutionConfig, PROJECT / "conf/execution"), load_folder(Teleop, PROJECT / "conf/teleop")
LIVE, CORE = load_folder(Live, PROJECT / "conf/live"), TELEOP.core
ms, mm, Hz = 1e-3, 1e-3, 1.0
FASTEST_CROSSOVER = next(part.le for part in WinchSettings.__annotations__["crossover"].__metadata__[0].metadata
                         if hasattr(part, "le"))  # fmt: skip
PLANNED = TELEOP.motors.share * VELOCITY[1]  # rad/s
DELAYED = hardware_robot.LEAD + (hardware_robot.SMOOTH - 1) * driver.TICK  # s that limbs are behind a plan

# In the order of the page: a sentence with each figure in brackets, and what the code has, in the sentence's own units.
# A row of a sentence that stands there twice holds both.
FIGURES = {
    PAGE: [
        (r"every ms it sends both limbs their setpoints for (30) ms later", [hardware_robot.LEAD / ms]),
        (r"without a permit for (80) ms it slows", [robot_process.DEAD_MAN / ms]),
        (r"run out \((30) ms\), do not come \((50) ms\) or are played late \((0\.3) s\)",
         [hardware_robot.LEAD / ms, watchdog.SETPOINT_TIMEOUT / ms, setpoint_filter.BEHIND]),
        (r"plays their setpoints, (1000) times a second", [1 / driver.TICK]),
        (r"or it is late itself \((50) ms\): the cables", [watchdog.SETPOINT_TIMEOUT / ms]),
        (r"A motor silent for (20) ms: no current", [motors.FEEDBACK_TIMEOUT / ms]),
        (r"or it is late itself \((50) ms\), a point", [watchdog.SETPOINT_TIMEOUT / ms]),
        (r"late by less than the (30) ms has no other effect", [hardware_robot.LEAD / ms]),
        (r"again (30) ms ahead", [hardware_robot.LEAD / ms]),
        (r"silent for (0\.1) s, or ends, is a fault of the robot", [driver_client.DRIVER_TIMEOUT]),
        (r"no permit for (80) ms", [robot_process.DEAD_MAN / ms]),
        (r"where the process is gone, for (0\.2) s, then no current", [local_driver_process.SETTLES]),
        (r"a joint (0\.05) rad off", [SET.panda.astray]),
        (r"a motor silent for (20) ms, too hot, or a cable (20) mm off",
         [motors.FEEDBACK_TIMEOUT / ms, SET.motors.astray / mm]),
        (r"Braking takes (0\.1) s where the Panda's", [BRAKE]),
        (r"joint 2 at its planned speed of (1\.09) rad/s needs (0\.15) s",
         [round(PLANNED, 2), round(PLANNED / (time_scaling.SHARE * ACCELERATION[1]), 2)]),
        (r"min\(1 / (0\.1) s, \((0\.95) a", [BRAKE, time_scaling.SHARE]),
        (r"is (39) ms behind that: (30) ms ahead of time, and two means over (10) ms",
         [DELAYED / ms, hardware_robot.LEAD / ms, hardware_robot.SMOOTH * driver.TICK / ms]),
        (r"Every (5) ms the robot's process moves towards", [time_scaling.STRIDE / ms]),
        (r"±(16384) = ±(3) A; feedback 0x204", [gm6020.FULL, gm6020.MOST_AMPERES]),
        (r"falls to 1 at (8) Hz, well below", [SET.motors.reel.crossover / Hz]),
        (r"up to (6\.4) mrad/A, nine times a turn", [simulated_motors.RIPPLE / 1e-3]),
        (r"(10) Hz is the most that settings may ask for", [FASTEST_CROSSOVER]),
        (r"from feedback at (1) kHz", [gm6020.RATE / 1e3]),
        (r"commands joint positions (1000) times", [1 / setpoint_filter.CYCLE]),
        (r"comes back to the plan within (0\.1) s with the least", [setpoint_filter.BRIDGED]),
        (r"one point every (10) ms", [ros_panda.PERIOD / ms]),
        (r"(0\.2) s of silence, or a joint (0\.1) rad off", [ros_panda.JOINT_STATE_TIMEOUT, SET.ros.astray]),
        (r"at most (30) ms of the way ahead", [hardware_robot.LEAD / ms]),
        (r"to within the (0\.1) rad", [SET.ros.astray]),
        (r"is sent (0\.15) s behind", [hardware_process.DELAY]),
        (r"the motion begins (0\.5) s later", [CORE.delay]),
        (r"the next input, then (0\.1) s of braking", [BRAKE]),
        (r"(0\.12) s of silence \(`silence`\), (0\.1) s of a lost controller",
         [CORE.safety.silence, CORE.safety.grace]),
        (r"after (2) s, or (0\.75) s where it was not yet seen to move, and as it follows, holds \| (0\.25) s \|",
         [controller.MOST_UNDRAWN, controller.UNBEGUN, controller.UNDRAWN]),
        (r"(0\.25) s, by its stamp or there and back", [clock.LATEST]),
        (r"sends nothing for (1) s", [lease.LEASE_TIMEOUT]),
        (r"at once, or (1) s", [lease.LEASE_TIMEOUT]),
        (r"along the plan \| (0\.08) s \|", [robot_process.DEAD_MAN]),
        (r"its process ends \| (0\.08) s \|", [robot_process.DEAD_MAN]),
        (r"the same as a stop \| (1) s \|", [follow.PLANNER_TIMEOUT]),
        (r"permits nothing \| (0\.15) s \|", [robot_process.STALE]),
        (r"a stream within (0\.1) to (0\.25) s, the tip (0\.1) and (0\.5) s",
         [stream_checks.LASTS, stream_checks.StreamLimits().silence + stream_checks.LASTS, correction_control.STRAYS,
          correction_control.BLIND]),
        (r"at rest it is awaited for (20) s", [correction_control.PATIENCE]),
        (r"a frame (0\.1) s old, or (0\.15) s without any, is a fault",
         [stream_checks.StreamLimits().age, stream_checks.StreamLimits().silence]),
        (r"at once if a write fails; after (1) s in which data", [LIVE.journal.period + log_writer.LATE]),
        (r"A token of (128) bits", [8 * auth.TOKEN_BYTES]),
        (r"valid for (2) minutes and (5) tries", [auth.CODE_SECONDS / 60, auth.CODE_TRIES]),
        (r"longer than (64) KiB, more than (400) a second", [server.LARGEST / 1024, client.PER_SECOND]),
    ],
}  # fmt: skip
# Not of the code: what others measured or published, and what was done to a session as it was timed.
OTHERS = {
    PAGE: ["14 to 17 Hz", "holds the grips for 1 s"],
}
UNITS = r"(?:ms|s|rad|N|mm|Hz|kHz|A|°C|m/s|KiB|bits|rad/s|mrad/A|times|minutes|tries)\b"


@cache
def written(page: str) -> str:
    """What people wrote: without generated blocks and code, and without line breaks."""
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"<!-- results/(\w+) -->.*?<!-- /results/\1 -->", "", text, flags=re.DOTALL)
    return " ".join(re.sub(r"```.*?```", "", text, flags=re.DOTALL).split())


ROWS = [(page, sentence, figures) for page, rows in FIGURES.items() for sentence, figures in rows]


@pytest.mark.parametrize(("page", "sentence", "figures"), ROWS, ids=[row[1][:40] for row in ROWS])
def test_a_figure_is_that_of_the_code(page, sentence, figures):
    matches = list(re.finditer(sentence, written(page)))
    assert matches, "the sentence is not there"
    for match in matches:
        assert [float(figure) for figure in match.groups()] == pytest.approx(figures, rel=1e-9)


@pytest.mark.parametrize("page", FIGURES)
def test_no_figure_with_a_unit_is_left_out(page):
    text = written(page)
    spans = [match.span() for sentence, _ in FIGURES[page] for match in re.finditer(sentence, text)]
    spans += [(at, at + len(words)) for words in OTHERS[page] for at in (text.find(words),) if at >= 0]
    left = [
        text[max(match.start() - 40, 0) : match.end() + 10]
        for match in re.finditer(rf"\d[\d.]*\s{UNITS}", text)
        if not any(low <= match.start() < high for low, high in spans)
    ]
    assert left == []


def test_words_for_figures_are_true_too():
    assert motors.HOMING == 60.0  # "for a minute at most"
    assert simulated_motors.PER_TURN == 9  # "nine times a turn"
    assert winch.MOST_AMPERES == gm6020.MOST_AMPERES
    assert auth.CODE_DIGITS == 6  # "six digits"
    assert gm6020.FEEDBACK == 0x204
    assert set(gm6020.GROUPS) == {0x1FE, 0x2FE}
    assert client.BURST == client.PER_SECOND
