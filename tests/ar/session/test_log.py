"""The log of a live session: the core goes through it again to the same bytes, `ingest` sees the arm in it, and neither
a killed process nor a full disk moves a robot or loses more than a second."""

import asyncio
import gc
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from itertools import count, groupby

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory

from tests.ar.session.test_robot_process import simulation
from tests.ar.session.test_serving import asked, executing, grips
from tests.ar.session.written import JOINTS, NAMES, REAL, SUBJECT, ZERO, Written
from tests.ar.teleop.test_plan import MOUNT, OFFSET, START, STRAIGHT, TIP
from tests.support import waiting
from tests.support.disks import filling, full, stuck
from tests.support.live import BODIES, RATE, controlling, hand, laid, patient
from tests.support.operator import PACKAGE, Everywhere, Operator
from tests.support.sessions import instruments, motion_truth, record
from tests.support.ticking import fed, ticks
from tests.support.workbench import ROOT
from trunkline.ar.dataset.recording import read_recording
from trunkline.ar.drivers.settings import ExecutionConfig as Execution
from trunkline.ar.session import replay
from trunkline.ar.session.binary import HANDS
from trunkline.ar.session.composition import subject_of
from trunkline.ar.session.hardware import hardware_of
from trunkline.ar.session.log_format import EVENTS, POSES, TWIN, Subject
from trunkline.ar.session.log_reader import read_session_log
from trunkline.ar.session.log_writer import LogWriter, LogWriterProcess, new_path
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Input, Pose, from_json, to_json
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.preparation.inspect import main as inspect
from trunkline.recordings.session.session import read_session
from trunkline.recordings.session.source import open_log

PERIOD = 0.2


UNHURRIED = patient(silence=5.0, plan_wait=30.0, start_wait=30.0)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Of a session in which a plan was executed to its end, another stopped, and its client went."""
    path = tmp_path_factory.mktemp("logs") / "run.mcap"
    log_writer = Written(path)

    async def session():
        async with laid(log_writer=log_writer, settings=UNHURRIED) as here:
            guest = await controlling(here)
            await executing(here, guest)
            await guest.hears("state", 60.0, mode="aim", robot="done")
            guest.left, guest.right = grips(MOUNT, stick_y=float("nan")), hand(MOUNT)
            await guest.hears("state", mode="hold")
            guest.left, guest.right = hand(MOUNT), hand(TIP)
            await guest.say(type="shown", digest="x")
            await guest.stop()
            await guest.hears("state", mode="stopped")
            guest.sending.cancel()
            await guest.socket.close()
            await asyncio.sleep(0.1)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("trunkline.ar.session.lease.LEASE_TIMEOUT", 60.0)
        asyncio.run(session())
    log_writer.close()
    return path


def core(**changes):
    return Teleoperation(replace(UNHURRIED, **changes), Everywhere(), PACKAGE, OFFSET)


@pytest.mark.realtime
def test_the_core_goes_through_a_log_again_to_the_same_bytes(log):
    log = read_session_log(log)
    assert log.damage == []
    assert len(log.steps) > RATE
    teleoperation = replay.core_of(log, PACKAGE, Everywhere())
    assert teleoperation.settings == UNHURRIED
    assert replay.replay(log.steps, teleoperation) is None


@pytest.mark.realtime
def test_the_first_difference_is_named_by_time_and_field(log):
    steps = read_session_log(log).steps
    aiming = next(n for n, step in enumerate(steps) if b'"mode":"aim"' in step.intent and b'"targets":{' in step.intent)
    core_input = from_json(Input, steps[aiming].input)
    (x, y, z), turn = core_input.left.position, core_input.left
    moved = replace(core_input, left=replace(turn, position=(x + 1e-9, y, z)))
    other = [*steps[:aiming], steps[aiming]._replace(input=to_json(moved)), *steps[aiming + 1 :]]
    difference = replay.replay(other, core())
    assert (difference.number, difference.time) == (aiming + 1, steps[aiming].time)
    assert difference.field.startswith("targets.rigid.position")
    assert f"step {aiming + 1} at {difference.time:.3f} s" in str(difference)
    difference = replay.replay(steps, core(delay=0.25))
    assert (difference.field, difference.replayed, difference.expected) == ("countdown", 0.25, 0.5)


@pytest.mark.realtime
def test_a_log_of_another_package_or_of_no_session_is_refused_by_name(log, tmp_path):
    with pytest.raises(InputError, match="package: found digest bbbbbbbbbbbb, expected aaaaaaaaaaaa"):
        replay.core_of(read_session_log(log), "b" * 64, Everywhere())
    path = tmp_path / "empty.mcap"
    Written(path).close()
    with pytest.raises(InputError, match="found no step of the core"):
        read_session_log(path)


@pytest.mark.realtime
def test_ingest_sees_the_arm_whole_and_takes_no_hand_for_it(log, capsys):
    assert inspect([str(log)]) == 0
    report, proposed = capsys.readouterr().out.split("Proposed session.yaml:\n")
    for name in NAMES:
        assert f"    {name:7}  seen in 100.0 %" in report
    assert f"frames of {BODIES} bodies, with orientations; " in report
    assert " 0 messages unreadable" in report
    assert f"/headset/{HANDS[0]}" in report
    assert "topics: {poses: /tf, commands: /tendons/command}" in proposed  # this robot measures no lengths
    assert "base: base" in proposed


def told_of(path, truth, **hardware):
    """A log of a session in which a robot did what `truth` says, and a twin, where it is one of hardware, as well."""
    bodies, tip = ("link_7", "base", *truth.markers), ("unit_08", (0.0, 0.0, 0.0))
    log_writer = Written(path, Subject(bodies, JOINTS, truth.tendons, STRAIGHT, tip, **hardware))
    base = np.append(truth.base_position, truth.base_quaternion)
    intent = (operator := Operator()).step()
    for row in range(0, len(truth.time), 4):
        at = log_writer.time = float(truth.time[row])
        if not row:
            log_writer.event("begin", tip={"body": tip[0], "place": tip[1]})
        arm = np.concatenate([truth.positions[row], truth.quaternions[row]], axis=1)
        pull, wound = truth.commands[row // 5], truth.tendon_positions[row]
        joints, nothing = START + 0.1 * np.sin(at), np.full(7, np.nan)
        poses = np.stack([base, base, *arm])
        log_writer.robot_state(
            RobotState(at, 0.0, joints, STRAIGHT - pull, nothing, poses, joints + 1e-4, STRAIGHT - wound)
        )
        for part in ("left", "right", "view"):
            log_writer.headset(part, at, base, False)
        log_writer.step(1 / 120, operator.message, intent)
    log_writer.close()


def test_a_session_in_which_the_arm_was_seen_is_one_to_identify_from(tmp_path, capsys):
    truth = motion_truth()
    told_of(tmp_path / "run.mcap", truth)
    assert inspect([str(tmp_path)]) == 0
    (tmp_path / "session.yaml").write_text(capsys.readouterr().out.split("Proposed session.yaml:\n")[1])
    session = read_session(tmp_path)
    session.markers = {name: name for name in truth.markers}  # the Panda's links are left out
    ((_, take, _),) = load_raw_trials(tmp_path, session, TrialLimits(0.2, 0.3, 0.1, 1.0))
    assert (take.markers, take.tendons) == (truth.markers, truth.tendons), take
    moves = take.time > 0.5  # poses that repeat themselves to the last bit are taken for frozen ones
    np.testing.assert_allclose(take.positions[moves], truth.positions[::4][moves], atol=1e-9)
    there = np.isfinite(take.base_positions).all(axis=1)
    np.testing.assert_allclose(take.base_positions[there], [truth.base_position] * there.sum(), atol=1e-9)
    np.testing.assert_allclose(take.tendon_positions, truth.tendon_positions[::4], atol=1e-12)
    assert take.commands.max() == pytest.approx(truth.commands.max(), rel=1e-3)


def test_what_a_twin_drew_of_a_real_machine_is_not_taken_for_the_arm(tmp_path, capsys):
    truth, path = motion_truth(), tmp_path / "run.mcap"
    told_of(path, truth, hardware=REAL)
    assert inspect([str(path)]) == 1
    output, message = capsys.readouterr()
    assert re.search(rf"{TWIN} +tf2_msgs/msg/TFMessage \(cdr\), drawn by a twin, not read", output)
    assert f"  {POSES} " not in output
    assert "no session.yaml to propose" in message
    (tmp_path / "session.yaml").write_text(
        "frame: {up: [0, 0, 1], unit: m}\nbase: base\ntopics: {commands: /tendons/command}\n"
        "trials: [{file: run.mcap, experiment: motion, split: identify}]\n"
    )
    with open(path, "rb") as file:
        rows = [row for row in make_reader(file).iter_messages() if not row[1].topic.startswith("/headset/")]
    merged(path, rows)
    with pytest.raises(InputError, match=f"no pose topic, found .*{TWIN}"):
        open_log(path, read_session(tmp_path))
    log = read_session_log(path)
    assert log.poses is None
    assert log.twin.names[-1] == "unit_08"
    assert read_recording(path).tip.names == ("tip.x.twin", "tip.y.twin", "tip.z.twin")


def merged(path, messages):
    """A log of all of them, (schema, channel, message), in the order of their log times."""
    with open(path, "wb") as file:
        writer, channels = Writer(file), {}
        writer.start(profile="ros2")
        for schema, channel, message in sorted(messages, key=lambda row: row[2].log_time):
            if channel.topic not in channels:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()


def test_with_motion_capture_merged_into_it_a_real_session_is_one_to_identify_from(tmp_path, capsys):
    """Its twin did something else: no part of that is taken."""
    truth = motion_truth()
    twin = replace(truth, positions=truth.positions[::-1] + 1.0)
    told_of(tmp_path / "run.mcap", twin, hardware=REAL)
    plain = instruments(
        position_noise_mm=0.0, orientation_noise_deg=0.0, occlusions_per_s=0.0, dropped_frames=0.0, outliers=0.0,
        stamp_jitter_ms=0.0, epoch_s=ZERO // 10**9,
    )  # fmt: skip
    record(tmp_path / "seen", [truth], plain)
    messages = []
    for path in (tmp_path / "run.mcap", tmp_path / "seen/motion_identify.mcap"):
        with open(path, "rb") as file:
            rows = list(make_reader(file).iter_messages())
        messages += [row for row in rows if path.name == "run.mcap" or row[1].topic == "/rigid_bodies"]
    (tmp_path / "merged").mkdir()
    merged(tmp_path / "merged/run.mcap", messages)
    assert inspect([str(tmp_path / "merged")]) == 0
    proposed = capsys.readouterr().out.split("Proposed session.yaml:\n")[1]
    topics = "{poses: /rigid_bodies, commands: /tendons/command, tendon_positions: /tendons/state}"
    assert f"topics: {topics}" in proposed
    (tmp_path / "merged/session.yaml").write_text(proposed)
    session = read_session(tmp_path / "merged")
    ((_, take, _),) = load_raw_trials(tmp_path / "merged", session, TrialLimits(0.2, 0.3, 0.1, 1.0))
    assert (take.markers, take.tendons) == (truth.markers, truth.tendons), take
    far = np.linalg.norm(take.positions[:, -1] - take.base_positions, axis=1)
    true = np.linalg.norm(truth.positions[::4, -1] - truth.base_position, axis=1)
    there = np.isfinite(far)
    assert there.sum() > 100
    np.testing.assert_allclose(far[there], true[: len(far)][there], atol=1e-3)


@pytest.mark.realtime
def test_a_log_says_what_of_its_robot_is_real(log):
    assert read_session_log(log).begin["hardware"] == "simulated"
    hardware = hardware_of("fr3", "simulated", "", "", load_folder(Execution, PROJECT / "conf/execution"))
    subject = subject_of(simulation(), hardware)
    assert (subject.hardware, subject.poses) == (hardware.words(), TWIN)
    assert subject_of(simulation()).poses == POSES


@pytest.mark.realtime
def test_events_tell_who_controlled_what_was_planned_and_how_it_ended(log):
    events = read_session_log(log).events
    kinds = [event["event"] for event in events]
    for kind in ("begin", "came", "clock", "control", "request", "planned", "preview", "piece", "foreseen", "shown",
                 "execute", "refused", "stop", "stopped", "left", "alignment", "world"):  # fmt: skip
        assert kind in kinds, kind
    modes = [mode for mode, _ in groupby(event["mode"] for event in events if event["event"] == "mode")]
    assert modes[:8] == ["hold", "aim", "plan", "preview", "ready", "delay", "execute", "aim"]
    assert modes[-1] == "stopped"
    digests = {e["digest"] for e in events if e["event"] in ("shown", "execute")}
    assert digests == {e["preview"]["digest"] for e in events if e["event"] == "preview"}
    assert [e["robot"]["mode"] for e in events if e["event"] == "robot"] == ["idle", "running", "done"]


@pytest.mark.realtime
def test_others_read_it_as_ros_2(log):
    with open(log, "rb") as file:
        messages = {}
        for _, channel, message, ros in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            messages.setdefault(channel.topic, []).append((message, ros))
    _, first = messages[POSES][0]
    assert [transform.child_frame_id for transform in first.transforms] == list(NAMES)
    assert first.transforms[0].header.frame_id == "rigid_base"
    assert first.transforms[0].transform.translation.z == 3.0
    _, fixed = messages["/tf_static"][0]
    assert (fixed.transforms[0].header.frame_id, fixed.transforms[0].child_frame_id) == ("rigid_base", "reference")
    message, joints = messages["/joints/command"][0]
    np.testing.assert_allclose(joints.position, START)
    assert message.log_time // 10**9 >= ZERO // 10**9
    pulls = np.array([ros.position for _, ros in messages["/tendons/command"]])
    np.testing.assert_allclose(pulls[0], 0.0, atol=1e-12)
    assert pulls.max() > 0.01  # a cable that is wound in is a pull of more than 0
    _, last = messages["/headset/left"][0]
    assert last.header.frame_id == "rigid_base"  # hands of a browser
    assert messages[EVENTS][0][1].data.startswith('{"event":"begin"')


def test_poses_that_are_no_newer_are_not_told_twice_and_what_is_not_there_is_left_out(tmp_path):
    log_writer = Written(tmp_path / "run.mcap")
    poses = np.tile([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0], (3, 1))
    poses[0] = np.nan
    for at in (1.0, 1.0, 0.9, 1.1):
        log_writer.robot_state(RobotState(at, 0.0, START, STRAIGHT, poses[0], poses))
    operator = Operator()
    log_writer.step(0.1, operator.message, operator.step())
    log_writer.close()
    poses = read_session_log(tmp_path / "run.mcap").poses
    assert poses.names == NAMES[1:]
    np.testing.assert_allclose(1e-9 * (poses.stamps - ZERO), [1.0, 1.1], atol=1e-6)


def test_what_is_sent_and_what_is_measured_are_told_apart_and_what_is_not_measured_is_left_out(tmp_path):
    log_writer = Written(tmp_path / "run.mcap")
    poses, unknown = np.tile([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0], (3, 1)), np.full(3, np.nan)
    log_writer.robot_state(RobotState(1.0, 0.0, START, STRAIGHT, poses[0], poses, START + 0.01, unknown))
    log_writer.close()
    with open(tmp_path / "run.mcap", "rb") as file:
        messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        by_topic = {channel.topic: ros for _, channel, _, ros in messages}
    np.testing.assert_allclose(by_topic["/joints/command"].position, START)
    np.testing.assert_allclose(by_topic["/joint_states"].position, START + 0.01)
    assert "/tendons/command" in by_topic
    assert "/tendons/state" not in by_topic


# --- the process


until = partial(waiting.until, seconds=20.0)


@pytest.mark.realtime
def test_a_process_that_is_killed_loses_less_than_a_second_and_says_so(tmp_path):
    path = tmp_path / "run.mcap"
    log_writer = LogWriterProcess(path, SUBJECT, PERIOD)
    log_writer.event("tick", number=0)
    until(lambda: path.exists() and path.stat().st_size > 500)
    times = fed(log_writer, 1.5)
    killed = time.monotonic()
    os.kill(log_writer.pid, signal.SIGKILL)
    log_writer.event("tick", number=-1)
    until(lambda: (log_writer.event("tick", number=-1), log_writer.fault)[1])
    assert log_writer.fault == "log: run.mcap: its process has ended; nothing is executed"
    numbers, damage = ticks(path)
    assert numbers == list(range(len(numbers)))  # none is missing in between
    assert damage != []
    assert killed - times[numbers[-1]] < 1.0
    log_writer.close()


SESSION = """
import sys, time
from pathlib import Path
if __name__ == "__main__":
    from trunkline.ar.session.log_writer import NOTHING, LogWriterProcess
    log_writer = LogWriterProcess(Path(sys.argv[1]), NOTHING, 60.0)
    for number in range(1, 301):
        log_writer.event("tick", number=number)
    while log_writer._waiting:
        time.sleep(0.01)
    time.sleep(0.1)
    print("told", flush=True)
    time.sleep(600)
"""


@pytest.mark.realtime
def test_a_process_that_hangs_is_a_fault_before_more_than_a_second_is_lost(tmp_path):
    path = tmp_path / "run.mcap"
    log_writer = LogWriterProcess(path, SUBJECT, 0.5)
    log_writer.event("tick", number=0)
    until(lambda: path.exists() and path.stat().st_size > 500)
    times = fed(log_writer, 1.2)
    os.kill(log_writer.pid, signal.SIGSTOP)
    stopped, number, longest = time.monotonic(), len(times), 0.0
    while not log_writer.fault:
        assert time.monotonic() - stopped < 10.0
        times.append(time.monotonic())
        number += 1
        before = time.thread_time()
        log_writer.event("tick", number=number)
        longest = max(longest, time.thread_time() - before)
        time.sleep(0.01)
    begun = time.monotonic()
    assert log_writer.fault == "log: run.mcap: its process does not answer for 1 s; nothing is executed"
    os.kill(log_writer.pid, signal.SIGKILL)
    log_writer.close()
    assert log_writer.fault
    numbers, damage = ticks(path)
    assert numbers == list(range(len(numbers)))
    assert begun - times[numbers[-1]] < 1.5  # 1.05, but for a busy machine
    assert longest < 0.05


@pytest.mark.realtime
def test_a_process_that_stalls_for_a_moment_is_no_fault(tmp_path):
    path = tmp_path / "run.mcap"
    log_writer = LogWriterProcess(path, SUBJECT, 0.5)
    log_writer.await_begun()
    count = len(fed(log_writer, 0.7))
    os.kill(log_writer.pid, signal.SIGSTOP)
    time.sleep(0.3)
    log_writer.event("tick", number=count + 1)
    os.kill(log_writer.pid, signal.SIGCONT)
    time.sleep(2.0)  # nothing waits, so nothing need be written
    assert not log_writer.fault
    log_writer.event("tick", number=count + 2)
    log_writer.close()
    assert ticks(path) == (list(range(1, count + 3)), [])


@pytest.mark.realtime
def test_a_process_that_comes_back_before_its_buffer_is_full_has_lost_nothing_and_ends_its_fault(tmp_path):
    path = tmp_path / "run.mcap"
    log_writer = LogWriterProcess(path, SUBJECT, 0.5)
    log_writer.await_begun()
    log_writer.event("tick", number=1)
    os.kill(log_writer.pid, signal.SIGSTOP)
    number = 1
    until_fault = time.monotonic() + 10.0
    while not log_writer.fault or time.monotonic() < until_fault - 8.0:
        assert time.monotonic() < until_fault
        log_writer.event("tick", number=(number := number + 1))
        time.sleep(0.01)
    assert log_writer.fault == "log: run.mcap: its process does not answer for 1 s; nothing is executed"
    os.kill(log_writer.pid, signal.SIGCONT)
    until(lambda: not log_writer.fault)
    log_writer.event("tick", number=number + 1)
    log_writer.close()
    assert ticks(path) == (list(range(1, number + 2)), [])


STILL = """
import sys, time
from pathlib import Path
from tests.support.ticking import fed
if __name__ == "__main__":
    from trunkline.ar.session.log_writer import NOTHING, LogWriterProcess
    log_writer = LogWriterProcess(Path(sys.argv[1]), NOTHING, 0.5)
    log_writer.await_begun()
    print(log_writer.pid, flush=True)
    fed(log_writer, 4.0)
    print(repr(log_writer.fault), flush=True)
    log_writer.close()
"""


@pytest.mark.realtime
def test_a_machine_that_stands_still_as_a_whole_is_no_fault(tmp_path):
    script = tmp_path / "session.py"
    script.write_text(STILL)
    session = subprocess.Popen([sys.executable, str(script), str(tmp_path / "run.mcap")], cwd=ROOT, text=True,
                               stdout=subprocess.PIPE, env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip
    both = [int(session.stdout.readline()), session.pid]
    time.sleep(0.5)
    for pid in both:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(2.0)
    for pid in reversed(both):
        os.kill(pid, signal.SIGCONT)
    assert session.stdout.readline() == "''\n"
    assert session.wait(20.0) == 0


def test_a_session_waits_until_its_log_has_begun(tmp_path, monkeypatch):
    path = tmp_path / "run.mcap"
    log_writer = LogWriterProcess(path, SUBJECT, PERIOD)
    log_writer.await_begun()
    assert path.exists()
    log_writer.close()
    monkeypatch.setattr("trunkline.ar.session.log_writer.BEGINS", 0.3)
    monkeypatch.setattr("trunkline.ar.session.log_writer.PATIENCE", 0.1)
    hangs = LogWriterProcess(tmp_path / "other.mcap", SUBJECT, PERIOD, stuck)
    hangs.await_begun()
    assert hangs.fault == "log: other.mcap: its process has not begun for 0.3 s; nothing is executed"
    hangs.close()


@pytest.mark.realtime
def test_where_the_session_itself_is_killed_its_log_is_ended_as_it_should(tmp_path):
    path, script = tmp_path / "run.mcap", tmp_path / "session.py"
    script.write_text(SESSION)
    session = subprocess.Popen([sys.executable, str(script), str(path)], cwd=ROOT, stdout=subprocess.PIPE,
                               env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip
    assert session.stdout.readline() == b"told\n"
    session.kill()
    session.wait()
    until(lambda: path.is_file() and path.stat().st_size > 0 and ticks(path) == (list(range(1, 301)), []))


def test_a_session_that_ends_leaves_a_whole_file(tmp_path):
    log_writer = LogWriterProcess(tmp_path / "ended.mcap", SUBJECT, PERIOD)
    count = len(fed(log_writer, 0.2))
    log_writer.close()
    numbers, damage = ticks(tmp_path / "ended.mcap")
    assert (numbers, damage) == (list(range(1, count + 1)), [])
    assert not log_writer.fault


@pytest.mark.realtime
@pytest.mark.parametrize("opened", [full, filling])
def test_a_full_disk_is_said_in_one_line_and_what_was_written_stays(tmp_path, opened):
    path = tmp_path / "run.mcap"
    log_writer = LogWriterProcess(path, SUBJECT, PERIOD, opened)
    numbers = count(1)

    def fails():
        log_writer.event("tick", number=next(numbers))
        return log_writer.fault

    until(fails)
    assert log_writer.fault == "log: run.mcap: no space left on device; nothing is executed"
    log_writer.close()
    if opened is filling:
        numbers, damage = ticks(path)
        assert numbers == list(range(1, len(numbers) + 1))
        assert len(numbers) > 10
        assert damage != []


@pytest.mark.realtime
def test_a_disk_that_does_not_answer_delays_nobody(tmp_path, monkeypatch):
    monkeypatch.setattr("trunkline.ar.session.log_writer.MOST", 200)
    monkeypatch.setattr("trunkline.ar.session.log_writer.PATIENCE", 0.1)
    log_writer = LogWriterProcess(tmp_path / "run.mcap", SUBJECT, PERIOD, stuck)
    longest = 0.0
    gc.disable()  # a collection of all that the tests have loaded is not the journal's
    for number in range(20_000):
        before = time.thread_time()
        log_writer.event("tick", number=number, filler="x" * 1000)
        longest = max(longest, time.thread_time() - before)
        if log_writer.fault:
            break
    gc.enable()
    assert log_writer.fault == "log: run.mcap: the disk does not keep up; nothing is executed"
    assert longest < 0.1
    log_writer.close()


class Failing(LogWriter):
    fault = ""


@pytest.mark.realtime
def test_where_the_log_ends_nothing_new_is_executed_and_all_are_told():
    async def session():
        log_writer = Failing()
        async with laid(log_writer=log_writer) as here:
            guest, watcher = await controlling(here), await here.come()
            state = await asked(here, guest)
            log_writer.fault = "log: run.mcap: no space left on device; nothing is executed"
            await asyncio.sleep(0.4)
            await guest.say(type="shown", digest=state["preview"])
            await guest.hears("state", mode="ready")
            assert (await watcher.hears("state", mode="ready"))["notice"].endswith(log_writer.fault)
            joints = here.robot.robot.joints.copy()
            guest.right = grips(TIP, trigger=1.0)
            await guest.hears("state", mode="stopped")
            assert log_writer.fault in (await watcher.hears("state", mode="stopped"))["notice"]
            assert here.log.count(log_writer.fault) == 1
            np.testing.assert_array_equal(here.robot.robot.joints, joints)

    asyncio.run(session())


@pytest.mark.realtime
def test_where_the_log_ends_a_robot_under_way_holds():
    async def session():
        log_writer = Failing()
        async with laid(log_writer=log_writer) as here:
            guest = await controlling(here)
            await executing(here, guest)
            await asyncio.sleep(0.2)
            log_writer.fault = "log: run.mcap: no space left on device; nothing is executed"
            await guest.hears("state", mode="stopped", robot="idle")
            assert here.robot.stops
            log_writer.fault = ""  # its process is back
            guest.left, guest.right = hand(MOUNT, primary=1.0), hand(TIP)
            await guest.hears("state", mode="aim", notice="")
            assert here.log[-1] == "log: written again"

    asyncio.run(session())


def test_a_folder_that_cannot_be_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="journal.folder: .*file/logs: not a directory"):
        new_path(tmp_path / "file/logs")
    assert new_path(tmp_path / "logs").parent.is_dir()


def test_a_lost_alignment_is_told_and_none_is_written_for_it(tmp_path):
    log_writer = Written(tmp_path / "run.mcap")
    log_writer.alignment(Pose((1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0)))
    log_writer.event("alignment", pose=None)
    log_writer.close()
    with open(tmp_path / "run.mcap", "rb") as file:
        topics = [c.topic for _, c, _ in make_reader(file).iter_messages()]
    assert sorted(topics) == [EVENTS, "/tf_static"]
