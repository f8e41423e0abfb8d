"""Tendons in the logs: whose they are, by which clock, and that a curl is refused without them."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as RosWriter

from tests.recordings.cleaning.test_loading import edit_session, one_trial, taken
from tests.recordings.filtering.test_gaps import SETTINGS
from tests.support.sessions import LIMITS, curl_truth, pull_truth
from trunkline.errors import InputError
from trunkline.recordings.cleaning.loading import _by_motion
from trunkline.recordings.cleaning.pulls import check_pulls
from trunkline.recordings.filtering.filter import filter_raw_trial
from trunkline.recordings.logs.bag2 import read_recording
from trunkline.recordings.logs.definitions import JOINT_STATE, KNOWN, RIGID_BODIES
from trunkline.recordings.logs.joint_stream import joint_stream
from trunkline.recordings.logs.messages import JOINTS, joint_state
from trunkline.recordings.session.source import motor_stream
from trunkline.recordings.trials.inventory import recorded_lines


def curl(folder, change=lambda m: None, clock="frame"):
    return one_trial(folder, change, curl_truth(), clock)


def refused_curl(folder, message):
    error = taken(folder)[0][0]
    assert isinstance(error, InputError), f"expected a refusal, found {error}"
    assert "curl_40.mcap" in str(error)
    assert re.search(message, str(error)), str(error)


@pytest.mark.parametrize("key", ["commands: /tendon_commands", "tendon_positions: /tendon_states"])
def test_curl_with_a_named_topic_that_no_log_has_is_refused(tmp_path, key):
    curl(tmp_path)
    edit_session(tmp_path, key, key + "_")
    refused_curl(tmp_path, r"found '/tendon_\w+_', which no log has, expected .*: /tendon_commands, /tendon_states")


def test_curl_without_any_tendon_is_refused(tmp_path):
    def silence(m):
        return replace(m, **{key: getattr(m, key)[:0] for key in ("command_logged", "command_stamps", "commands")})

    def silence_both(m):
        keys = ("tendon_logged", "tendon_stamps", "tendon_positions")
        return replace(silence(m), **{key: getattr(m, key)[:0] for key in keys})

    curl(tmp_path, silence_both)
    edit_session(tmp_path, ", commands: /tendon_commands, tendon_positions: /tendon_states", "")
    refused_curl(tmp_path, "found no command topic and no tendon position topic among: none .*, expected commands")
    raw, _ = curl(tmp_path, silence)
    assert isinstance(raw, InputError), "session.yaml names a command topic that no log has"
    edit_session(tmp_path, "commands: /tendon_commands, ", "")
    assert len(taken(tmp_path)[0][0].tendon_time) > 400, "tendon positions alone will do"


@pytest.mark.parametrize(
    ("commands", "positions", "message"),
    [
        (60, -60, r"[56]\d\.\d+ s after the poses and \d+ messages on /tendon_states, [56]\d\.\d+ s before the poses, "
         "expected commands or tendon positions within 1 s of the poses"),
        (3600, 0, r"3597.\d+ s after the poses and \d+ messages on /tendon_states, expected commands and tendon "
         "positions within 1 s of the poses"),  # positions are there
    ],
)  # fmt: skip
def test_a_curl_whose_motors_clock_is_too_far_off_is_refused(tmp_path, commands, positions, message):
    def ahead(m):
        m.command_stamps[:] += commands * 1_000_000_000
        m.tendon_stamps[:] += positions * 1_000_000_000

    curl(tmp_path, ahead)
    refused_curl(tmp_path, r"found \d+ messages on /tendon_commands, " + message)


@pytest.mark.parametrize("clock", ["log", "frame"])
def test_motors_without_stamps_are_dated_by_the_recorder(tmp_path, clock):
    def zero(m):
        m.command_stamps[:] = m.tendon_stamps[:] = 0

    raw, findings = curl(tmp_path, zero, clock)
    assert len(raw.command_time) > 100
    assert len(raw.tendon_time) > 400
    repairs = [repair for repair in findings.repairs if "dated by the recorder's clock" in repair]
    assert len(repairs) == (0 if clock == "log" else 2)


@pytest.mark.parametrize(("rate", "words"), [(1.05, "faster"), (0.95, "slower")])
def test_motors_of_a_clock_of_another_rate_are_refused(tmp_path, rate, words):
    def drift(m):
        for stamps in (m.command_stamps, m.tendon_stamps):
            stamps[:] = stamps[0] + np.round(rate * (stamps - stamps[0]))

    curl(tmp_path, drift)
    refused_curl(tmp_path, rf"/tendon_commands: command stamps run (4.9|5).* % {words} than the stamps of the poses")
    edit_session(tmp_path, "clock: frame", "clock: log")
    raw, _ = taken(tmp_path)[0]
    assert not isinstance(raw, InputError), "as the message says"


def test_motors_of_a_clock_that_is_off_by_what_quartzes_are_pass(tmp_path):
    def drift(m):
        for stamps in (m.command_stamps, m.tendon_stamps):
            stamps[:] = stamps[0] + np.round((1 + 2e-4) * (stamps - stamps[0]))

    raw, findings = curl(tmp_path, drift)
    assert not isinstance(raw, InputError)
    assert not any("stamps" in line for line in findings.warnings)


def test_tendons_take_the_names_of_the_session(tmp_path):
    def rename(m):
        return replace(m, tendons=("motor_1", "motor_2", "motor_3"))

    plain, _ = curl(tmp_path)
    curl(tmp_path, rename)
    edit_session(
        tmp_path, "base: base", "base: base\ntendons: {motor_3: tendon_3, motor_1: tendon_1, motor_2: tendon_2}"
    )
    raw, _ = taken(tmp_path)[0]
    assert raw.tendons == ("tendon_3", "tendon_1", "tendon_2")
    np.testing.assert_array_equal(raw.commands, plain.commands[:, [2, 0, 1]])
    np.testing.assert_array_equal(raw.tendon_positions, plain.tendon_positions[:, [2, 0, 1]])
    edit_session(tmp_path, "motor_3:", "motor_4:")
    edit_session(tmp_path, "tendon_3", "tendon_4")
    refused_curl(tmp_path, "command topic: found motor_1, motor_2, motor_3, expected 'motor_4' as in session.yaml")


def test_a_motor_may_wind_several_tendons_by_degrees_of_its_drum(tmp_path):
    plain, _ = curl(tmp_path)
    curl(tmp_path, lambda m: replace(m, tendons=("m1", "m2", "m3")))
    pair = "m1: {unit: deg, spool_radius: 0.02, tendons: {tendon_1: 1, tendon_2: -1}}"
    edit_session(
        tmp_path, "base: base", f"base: base\nmotors: {{m2: {{unit: mm, tendons: {{tendon_3: 0.5}}}}, {pair}}}"
    )
    raw, _ = taken(tmp_path)[0]
    turned = np.pi / 180 * 0.02 * plain.commands[:, 0]
    assert raw.tendons == ("tendon_3", "tendon_1", "tendon_2")
    np.testing.assert_allclose(
        raw.commands, np.stack([5e-4 * plain.commands[:, 1], turned, -turned], axis=1), atol=1e-15
    )
    edit_session(tmp_path, "m2:", "m4:")
    refused_curl(tmp_path, "command topic: found m1, m2, m3, expected 'm4' as in session.yaml")


def messages_of(folder, split, floats=False):
    """The log of the curl with its commands and measured positions as `split` makes them of each message: a list of
    (topic, names, positions). floats: as arrays of numbers alone."""
    original = (folder / "curl_40.mcap").rename(folder / "original.log")
    with open(original, "rb") as file, open(folder / "curl_40.mcap", "wb") as out, RosWriter(out) as writer:
        arrays = ("std_msgs/msg/Float64MultiArray", KNOWN["std_msgs/Float64MultiArray"])
        joints = writer.register_msgdef(*(arrays if floats else ("sensor_msgs/msg/JointState", JOINT_STATE)))
        bodies = writer.register_msgdef("mocap4r2_msgs/msg/RigidBodies", RIGID_BODIES)
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message, content in reader.iter_decoded_messages():
            if not schema.name.endswith("JointState"):
                writer.write_message(channel.topic, bodies, content, message.log_time)
                continue
            for topic, names, positions in split(channel.topic, list(content.name), list(content.position)):
                plain = {"header": content.header, "name": names, "position": positions, "velocity": [], "effort": []}
                plain = {"layout": {"dim": [], "data_offset": 0}, "data": positions} if floats else plain
                writer.write_message(topic, joints, plain, message.log_time)


def changed(tmp_path, split, old="", new=""):
    """(as recorded, as `split` made it) of a curl."""
    before, _ = curl(tmp_path)
    messages_of(tmp_path, split)
    if old:
        edit_session(tmp_path, old, new)
    ((after, findings),) = taken(tmp_path)
    assert not isinstance(after, InputError), str(after)
    return before, after, findings


def same_pulls(before, after, atol=1e-9):
    assert after.tendons == before.tendons
    for key in ("command", "tendon"):
        time = getattr(before, f"{key}_time")
        values = "commands" if key == "command" else "tendon_positions"
        mine = [np.interp(time, getattr(after, f"{key}_time"), column) for column in getattr(after, values).T]
        np.testing.assert_allclose(np.stack(mine, axis=1), getattr(before, values), atol=atol)


def test_a_message_for_each_motor_is_put_together(tmp_path):
    before, after, findings = changed(
        tmp_path, lambda topic, names, at: [(topic, [name], [pull]) for name, pull in zip(names, at, strict=True)]
    )
    same_pulls(before, after)
    assert any("hold some of 3 motors each" in line for line in findings.repairs)


def test_a_topic_for_each_motor_is_put_together(tmp_path):
    def split(topic, names, at):
        return [(f"/{name}{topic}", [name], [pull]) for name, pull in zip(names, at, strict=True)]

    topics = ", commands: /tendon_commands, tendon_positions: /tendon_states"
    same_pulls(*changed(tmp_path, split, topics)[:2])
    named = [f"/tendon_{number}/tendon_commands" for number in (1, 2, 3)]
    edit_session(tmp_path, "topics: {", f"topics: {{commands: [{', '.join(named)}], ")
    assert taken(tmp_path)[0][0].tendons == ("tendon_1", "tendon_2", "tendon_3")


def test_joints_without_names_go_by_tendons(tmp_path):
    curl(tmp_path)
    messages_of(tmp_path, lambda topic, names, at: [(topic, [], at)])
    refused_curl(tmp_path, "found 3 numbers without names, expected `tendons` in session.yaml")
    with open(tmp_path / "session.yaml", "a") as file:
        file.write("tendons: [tendon_1, tendon_2, tendon_3]\n")
    assert taken(tmp_path)[0][0].tendons == ("tendon_1", "tendon_2", "tendon_3")


def test_float_arrays_count_by_log_time(tmp_path):
    stamped, _ = curl(tmp_path)
    messages_of(tmp_path, lambda topic, names, at: [(topic, names, at)], floats=True)
    refused_curl(tmp_path, "/tendon_commands: found 3 numbers without names, expected `tendons`")
    with open(tmp_path / "session.yaml", "a") as file:
        file.write("tendons: [tendon_1, tendon_2, tendon_3]\n")
    raw, findings = taken(tmp_path)[0]
    assert raw.tendons == stamped.tendons
    # the recorder dates all messages by one clock, so that of the offset of 137 ms only the delivery's jitter is left
    pulls = np.interp(raw.command_time, stamped.command_time - 0.137, stamped.commands[:, 0])
    np.testing.assert_allclose(raw.commands[:, 0], pulls, atol=2e-3)
    assert findings.by_log_times.offset == pytest.approx(0, abs=0.02)
    assert abs(raw.command_time[0]) < 0.02


def test_joints_of_another_robot_are_left_out(tmp_path):
    def split(topic, names, at):
        return [("/joint_states", ["panda_joint1"], at[:1])] if topic == "/tendon_states" else [(topic, names, at)]

    _, after, findings = changed(tmp_path, split, ", tendon_positions: /tendon_states")
    assert len(after.tendon_time) == 0
    assert any("/joint_states left out as tendon position topic: found panda_joint1" in r for r in findings.repairs)


@pytest.mark.parametrize("nothing", ["none", "", "null"])
def test_a_role_that_no_topic_has_may_be_said(tmp_path, nothing):
    curl(tmp_path)
    edit_session(tmp_path, "tendon_positions: /tendon_states", f"tendon_positions: {nothing}")
    assert len(taken(tmp_path)[0][0].tendon_time) == 0


@pytest.mark.parametrize("every", [2, 4])
def test_commands_of_two_publishers_are_refused(tmp_path, every):
    curl(tmp_path)
    count = 0

    def split(topic, names, at):
        nonlocal count
        count += topic == "/tendon_commands"
        mixed = topic == "/tendon_commands" and count % every == 0
        return [(topic, names, [0.0] * 3 if mixed else at)]

    messages_of(tmp_path, split)
    refused_curl(tmp_path, r"/tendon_commands: commands jump to and fro \d+ times, .* two publishers .* expected one")


def test_an_encoder_that_counts_one_turn_is_unwrapped(tmp_path):
    radius = 0.005

    def split(topic, names, at):
        angles = np.array(at) / radius
        return [(topic, names, (angles % (2 * np.pi) if topic == "/tendon_states" else angles).tolist())]

    motors = "".join(
        f"  tendon_{k}: {{unit: rad, spool_radius: {radius}, tendons: {{tendon_{k}: 1}}}}\n" for k in (1, 2, 3)
    )
    before, after, findings = changed(tmp_path, split, "trials:", f"motors:\n{motors}trials:")
    same_pulls(before, after)
    assert any("of an encoder that counts one turn" in line for line in findings.repairs)


def test_commands_that_are_sent_on_change_hold(tmp_path):
    last = None

    def split(topic, names, at):
        nonlocal last
        if topic != "/tendon_commands":
            return [(topic, names, at)]
        steps = [0.01 * round(pull / 0.01) for pull in at]
        changes, last = steps != last, steps
        return [(topic, names, steps)] if changes else []

    _, after, _ = changed(tmp_path, split)
    sent = np.interp(after.command_time[-1] * np.linspace(0, 1, 500), after.command_time, after.commands[:, 0])
    assert np.mean(np.abs(sent / 0.01 - np.round(sent / 0.01)) > 1e-3) < 0.02, "steps, no ramps between them"


def test_a_command_that_was_sent_before_the_poses_holds_an_arm_at_rest(tmp_path):
    def latched(m):
        first = {"command_stamps": m.command_stamps[:1] - 7_500_000_000, "command_logged": m.command_logged[:1]}
        none = {key: getattr(m, key)[:0] for key in ("tendon_stamps", "tendon_logged", "tendon_positions")}
        return replace(m, **first, **none, commands=m.commands[:1])

    before, _ = one_trial(tmp_path, truth=pull_truth())
    one_trial(tmp_path, latched, pull_truth())
    edit_session(tmp_path, ", tendon_positions: /tendon_states", "")
    ((after, findings),) = taken(tmp_path)
    assert not isinstance(after, InputError), str(after)
    np.testing.assert_array_equal(after.commands, before.commands[:1])
    assert any("s before the poses: the last holds" in line for line in findings.repairs)


def forced(folder, tensions):
    """The pull, its motors commanded by torques at drums of 2 cm that pull with these N."""
    torques = np.asarray(tensions) * 0.02
    pulled = one_trial(folder, lambda m: replace(m, commands=np.broadcast_to(torques, m.commands.shape)), pull_truth())
    assert not isinstance(pulled[0], InputError)
    motors = "".join(f"  tendon_{k}: {{unit: Nm, spool_radius: 0.02, tendons: {{tendon_{k}: 1}}}}\n" for k in (1, 2, 3))
    edit_session(folder, "trials:", f"motors:\n{motors}trials:")
    edit_session(folder, ", tendon_positions: /tendon_states", "")
    ((raw, _),) = taken(folder)
    return raw


def test_torques_of_drums_are_newtons_of_tension(tmp_path):
    raw = forced(tmp_path, [4.0, 0.0, 1.5])
    assert raw.command_unit == "N"
    np.testing.assert_allclose(raw.commands, np.broadcast_to([4.0, 0.0, 1.5], raw.commands.shape), atol=1e-12)
    assert not raw.tendon_positions.size, "what encoders measure is no force"
    assert check_pulls(raw, 0.5, 0.01, 2.0, {}) == [], "5 N are no 5 m"
    trial, _ = filter_raw_trial(raw, SETTINGS)
    assert (trial.command_unit, trial.commands[0].tolist()) == ("N", pytest.approx([4.0, 0.0, 1.5]))
    assert recorded_lines([trial]) == ["static pulls: 1 identify, 0 validate, 0 test; pulls of up to 4 N"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda raw: replace(raw, commands=-raw.commands), "from -4 to 0 N, expected positive .* is the sign reversed"),
        (lambda raw: replace(raw, experiment="release"), "'tendon_1' is pulled by 4 N, expected a release without"),
        (lambda raw: replace(raw, commands=np.linspace(0, 2, len(raw.commands))[:, None] * raw.commands),
         "'tendon_1' is pulled by .* N more at times, expected a static_pull to hold them"),
    ],
)  # fmt: skip
def test_tensions_that_cannot_be_are_named(tmp_path, change, message):
    raw = forced(tmp_path, [4.0, 0.0, 1.5])
    (fault,) = check_pulls(change(raw), 0.5, 0.01, 2.0, {})
    assert re.search(message, fault), fault


def test_a_large_tension_may_vary_by_some_of_it_where_it_is_held(tmp_path):
    raw = forced(tmp_path, [4.0, 0.0, 1.5])
    wavering = 1.0 + 0.01 * np.sign(np.sin(np.arange(len(raw.commands))))[:, None]
    assert check_pulls(replace(raw, commands=100 * wavering * raw.commands), 0.5, 0.01, 2.0, {}) == []


def test_the_clock_is_not_sought_in_how_an_arm_swings_under_tensions(tmp_path):
    raw, _ = curl(tmp_path)
    assert _by_motion(raw, LIMITS) is not None
    assert _by_motion(replace(raw, command_unit="N"), LIMITS) is None


@pytest.mark.parametrize(
    ("position", "effort", "forces", "numbers"),
    [([0.3, 1.2], [4.0, 5.0], True, [4.0, 5.0]), ([0.3, 1.2], [4.0, 5.0], False, [0.3, 1.2]),
     ([], [4.0, 5.0], True, [4.0, 5.0]), ([4.0, 5.0], [], True, [4.0, 5.0])],
)  # fmt: skip
def test_forces_are_the_efforts_of_joint_states_where_they_have_any(tmp_path, position, effort, forces, numbers):
    stamp = {"sec": 1, "nanosec": 0}
    message = {"header": {"stamp": stamp, "frame_id": ""}, "name": ["a", "b"], "position": position, "velocity": [],
               "effort": effort}  # fmt: skip
    with open(tmp_path / "log.mcap", "wb") as file:
        writer = RosWriter(file)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        writer.write_message("/sent", schema, message, log_time=10**9, publish_time=10**9)
        writer.finish()
    topic = read_recording(tmp_path / "log.mcap", JOINTS.keys()).topics["/sent"]
    np.testing.assert_array_equal(joint_stream(topic, forces=forces).positions, [numbers])


def test_a_joint_state_without_efforts_is_read():
    """JSON may leave an empty list out."""
    header = SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=0))
    joints = joint_state(SimpleNamespace(header=header, name=["a"], position=[0.1]))
    assert (joints.positions.tolist(), joints.efforts) == ([0.1], None)


def commands_in(path, messages):
    """A log of commands, JSON in the schema JointState; bytes as they are."""
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/JointState", "jsonschema", b"")
        channel = writer.register_channel("/sent", "json", schema)
        for number, message in enumerate(messages):
            data = message if isinstance(message, bytes) else json.dumps(message).encode()
            writer.add_message(channel, 10**9 + number * 10**7, data, 10**9)
        writer.finish()
    return read_recording(path, JOINTS.keys())


SENT = {"header": {"stamp": {"sec": 1, "nanosec": 0}}, "name": ["a"], "position": [0.1]}
UNNAMED = {"header": {"stamp": {"sec": 1, "nanosec": 0}}, "names": ["a"], "position": [0.1]}


@pytest.mark.parametrize(("wrong", "reason"), [(b"{", ""), (UNNAMED, ": it has no name")])
def test_commands_that_cannot_be_read_are_refused_by_their_topic_and_some_of_them_named(tmp_path, wrong, reason):
    stream, _ = motor_stream(commands_in(tmp_path / "some.mcap", [SENT, wrong, wrong]), "/sent", "command", (), None)
    assert stream is not None
    assert (len(stream.stamps), stream.undecodable) == (1, 2)
    assert stream.notes == ["/sent: 2 messages that do not fit their schema dropped"]
    expected = f"none.mcap: /sent: none of its 2 messages fits their schema sensor_msgs/msg/JointState{reason}"
    with pytest.raises(InputError, match=f"{expected}$"):
        motor_stream(commands_in(tmp_path / "none.mcap", [wrong, wrong]), "/sent", "command", (), None)
