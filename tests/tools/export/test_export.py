"""An exported session is a whole MCAP that its own library checks, with what was measured and what was simulated."""

import json
import shutil

import mujoco
import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from scipy.spatial.transform import Rotation

from tests.recordings.logs.test_schemas import a_session
from tests.support.folders import ROOT
from tests.support.forced_arm import forced_pull, forced_spec
from tests.support.matched_plant import curl, release, small_model, tilt
from tests.tools.evaluate.test_evaluate import softer, write_model
from trunkline.recordings.session.source import open_log
from trunkline.recordings.trials.trial import write_trials
from trunkline.tools.evaluate.__main__ import main as evaluate
from trunkline.tools.export.__main__ import main
from trunkline.tools.export.messages import Color, identifier, scene

RATE = 120  # frames a second of these trials
UNSEEN = slice(10, 20)  # frames in which nobody saw the second marker


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A model that is too soft, trials of another, and their export."""
    root = tmp_path_factory.mktemp("exported")
    (root / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    model = small_model(4)
    trials = [tilt(model, 45, "validate"), release(model, 0.3, "test", 60), curl(model, 40, frames=60)]
    trials[1].measured[UNSEEN, 1] = False
    trials[2].tendons = ("tendon 1", *trials[2].tendons[1:])
    (root / "session").mkdir()
    write_trials(root / "session", [trials[0], trials[1], curl(model, 40, frames=60)])
    write_model(root / "arm.xml", softer())
    words = [str(root / name) for name in ("arm.xml", "session", "out.mcap")]
    assert main([*words, "--settings", str(root)]) == 0
    return root, trials


@pytest.fixture(scope="module")
def contents(made):
    """Decoded messages by topic, with their times in s, and the trials' metadata."""
    topics: dict[str, list] = {}
    with open(made[0] / "out.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            topics.setdefault(channel.topic, []).append((message.log_time / 1e9, decoded))
        metadata = [record.metadata for record in reader.iter_metadata()]
    return topics, metadata


def test_the_file_is_whole_in_order_and_indexed(made, contents):
    topics, _ = contents
    root, trials = made
    with open(root / "out.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary, times = reader.get_summary(), [m.log_time for _, _, m in reader.iter_messages(log_time_order=False)]
    assert times == sorted(times)
    statistics = summary.statistics
    assert statistics.message_count == len(times) == sum(map(len, topics.values()))
    assert (statistics.message_start_time, statistics.message_end_time) == (times[0], times[-1])
    assert len(summary.chunk_indexes) == statistics.chunk_count > 0
    assert [index.name for index in summary.metadata_indexes] == [f"trial {trial.name}" for trial in trials]
    assert sum(statistics.channel_message_counts.values()) == len(times)
    names = [schema.name for schema in summary.schemas.values()]
    assert sorted(names) == ["foxglove.FrameTransforms", "foxglove.Log", "foxglove.PointCloud", "foxglove.SceneUpdate",
                             "trunkline.Errors", "trunkline.Pulls"]  # fmt: skip


def test_measured_and_simulated_bodies_are_where_they_are_in_the_trial(made, contents):
    topics, metadata = contents
    _, trials = made
    begin, end = (1e-9 * int(metadata[1][f"{edge}_ns"]) for edge in ("begin", "end"))
    frames = [message for time, message in topics["/measured/tf"] if begin <= time <= end]
    first = len(trials[1].time) - len(frames)  # frames before are those of the hold
    for number, message in enumerate(frames):
        row = first + number
        names = [link.child_frame_id for link in message.transforms]
        there = np.flatnonzero(trials[1].measured[row])
        assert names == [f"measured/{trials[1].markers[i]}" for i in there]
        places = [[getattr(link.translation, axis) for axis in "xyz"] for link in message.transforms]
        np.testing.assert_allclose(places, trials[1].positions[row, there], atol=1e-12)
        turns = [[getattr(link.rotation, axis) for axis in "wxyz"] for link in message.transforms]
        np.testing.assert_allclose(turns, trials[1].quaternions[row, there], atol=1e-12)
        assert {link.parent_frame_id for link in message.transforms} == {"base"}
    simulated = [message for time, message in topics["/simulated/tf"] if begin <= time <= end]
    errors = [message for time, message in topics["/errors_mm"] if begin <= time <= end]
    assert {len(message.transforms) for message in simulated} == {4}
    for model, real, error in zip(simulated, frames, errors, strict=True):
        tips = [[getattr(m.transforms[-1].translation, axis) for axis in "xyz"] for m in (model, real)]
        assert error.tip == pytest.approx(1e3 * np.linalg.norm(np.subtract(*tips)), abs=1e-9)
        assert error.tip == error.unit_04


def test_errors_are_those_of_evaluate_and_what_nobody_saw_has_none(made, contents, tmp_path):
    root, trials = made
    topics, metadata = contents
    words = [str(root / name) for name in ("arm.xml", "session")]
    assert evaluate([*words, "--settings", str(root), "--out", str(tmp_path / "out")]) == 0
    table = pd.read_csv(tmp_path / "out/trials.csv")
    table = table[table.model == "model"].set_index("trial")
    assert [row["trial"] for row in metadata] == [trial.name for trial in trials]
    for row in metadata:
        assert float(row["error_mm"]) == pytest.approx(table.e_position_mm[row["trial"]], rel=1e-5)
        assert float(row["tip_error_mm"]) == pytest.approx(table.e_tip_mm[row["trial"]], rel=1e-5)
        assert (row["experiment"], row["split"]) == tuple(table.loc[row["trial"], ["experiment", "split"]])
    unseen = [message for _, message in topics["/errors_mm"] if np.isnan(message.unit_02)]
    assert len(unseen) == UNSEEN.stop - UNSEEN.start
    assert all(np.isfinite([message.mean, message.tip]).all() for message in unseen)
    gravity = [float(metadata[0][f"gravity_{axis}_m_s2"]) for axis in "xyz"]
    np.testing.assert_allclose(gravity, trials[0].gravity, atol=1e-6)


def test_trials_come_one_after_another_and_commands_with_theirs(made, contents):
    topics, metadata = contents
    _, trials = made
    spans = [[1e-9 * int(row[f"{edge}_ns"]) for edge in ("begin", "end")] for row in metadata]
    assert spans[0][0] == spans[0][1] == 1.0  # at rest: one frame
    assert [after[0] - before[1] for before, after in zip(spans, spans[1:], strict=False)] == pytest.approx([1.0, 1.0])
    assert [(time, trial.message.partition(":")[0]) for time, trial in topics["/trial"]] == [
        (begin, trial.name) for (begin, _), trial in zip(spans, trials, strict=True)
    ]
    pulled = [(time, message.tendon_1) for time, message in topics["/commands_mm"] if time >= spans[2][0]]
    rows = trials[2].commands[-len(pulled) :, 0]
    np.testing.assert_allclose([pull for _, pull in pulled], 1e3 * rows, atol=1e-9)
    steps = np.diff([time for time, _ in pulled])
    np.testing.assert_allclose(steps, 1 / RATE, atol=2e-9)
    assert [time for time, _ in topics["/pulls_mm"]] == [time for time, _ in topics["/commands_mm"]]
    shapes = np.array([time for time, _ in topics["/simulated/arm"] if time >= spans[2][0]])
    assert np.diff(shapes).min() >= 1 / 40 - 1e-6  # viewers need no more


def test_the_arm_is_drawn_from_the_mount_through_its_bodies(made, contents):
    (_, real), (_, model) = (contents[0][f"/{name}/arm"][0] for name in ("measured", "simulated"))
    for message, name in ((real, "measured"), (model, "simulated")):
        (entity,) = message.entities
        assert (entity.id, entity.frame_id, len(entity.cylinders)) == (name, "base", 4)
    tips = {link.child_frame_id: link.translation for _, message in contents[0]["/simulated/tf"][:1]
            for link in message.transforms}  # fmt: skip
    cone = model.entities[0].cylinders[-1]
    end = tips["simulated/unit_04"]
    assert min(np.linalg.norm(np.subtract(edge, [end.x, end.y, end.z])) for edge in edges(cone)) < 1e-9
    arm = mujoco.MjModel.from_xml_path(str(made[0] / "arm.xml"))
    (unit,) = np.flatnonzero(arm.geom_bodyid == arm.body("unit_04").id)
    assert min(cone.bottom_scale, cone.top_scale) * cone.size.x / 2 == pytest.approx(arm.geom_size[unit, 0])
    assert real.entities[0].cylinders[0].color != cone.color


def edges(cone) -> list[np.ndarray]:
    """Where its axis begins and ends, m: at its bottom and its top."""
    pose = cone.pose
    turn = Rotation.from_quat([getattr(pose.orientation, axis) for axis in "xyzw"])
    center = np.array([getattr(pose.position, axis) for axis in "xyz"])
    return [center + turn.apply([0, 0, side * cone.size.z / 2]) for side in (-1, 1)]


def test_bodies_are_points_too_where_they_are_in_colors_of_measured_and_simulated(contents):
    topics, _ = contents
    colors = []
    for name in ("measured", "simulated"):
        places = {time: [[getattr(link.translation, axis) for axis in "xyz"] for link in message.transforms]
                  for time, message in topics[f"/{name}/tf"]}  # fmt: skip
        assert [time for time, _ in topics[f"/{name}/points"]] == [time for time, _ in topics[f"/{name}/arm"]]
        for time, message in topics[f"/{name}/points"]:
            points = unpacked(message)
            assert message.frame_id == "base"
            np.testing.assert_allclose([points[axis] for axis in "xyz"], np.transpose(places[time]), atol=1e-7)
        colors.append({tuple(int(point[color]) for color in ("red", "green", "blue", "alpha")) for point in points})
    assert [len(different) for different in colors] == [1, 1]
    assert not colors[0] & colors[1]
    sizes = [len(message.data) // message.point_stride for _, message in topics["/measured/points"]]
    assert set(sizes) == {3, 4}  # what nobody saw is no point


def unpacked(message) -> np.ndarray:
    """The points of a foxglove.PointCloud by its own description. A record of its fields, (N,)."""
    kinds = {1: "u1", 7: "<f4"}
    names, offsets, types = zip(*[(f.name, f.offset, kinds[f.type]) for f in message.fields], strict=True)
    layout = {"names": names, "formats": types, "offsets": offsets, "itemsize": message.point_stride}
    return np.frombuffer(message.data, np.dtype(layout))


@pytest.mark.parametrize("end", [(0, 0, -1), (0, 0, 1), (1, 0, 0), (0.3, -0.5, -0.2), (-0.1, 0.2, 0.6)])
def test_a_cone_goes_from_each_point_to_the_next_as_thick_as_there(end):
    start = np.array([0.1, 0.2, 0.3])
    points, radii = np.array([start, np.full(3, np.nan), start + end]), np.array([0.04, 9.0, 0.01])
    (entity,) = scene(5, "arm", points, radii, Color(r=1)).entities
    (cone,) = entity.cylinders
    scales = np.array([cone.bottom_scale, cone.top_scale])
    thick = scales * cone.size.x / 2
    ends = [points[0], points[2]] if thick[0] > thick[1] else [points[2], points[0]]
    np.testing.assert_allclose(edges(cone), ends, atol=1e-12)
    assert sorted(thick) == pytest.approx([0.01, 0.04])
    assert scales.max() == 1


def test_measured_bodies_are_read_back_by_ingest_s_own_reader(made):
    root, trials = made
    poses = open_log(root / "out.mcap", a_session(topics={"poses": "/measured/tf"})).poses
    assert tuple(f"measured/{name}" for name in trials[0].markers) == poses.names
    np.testing.assert_allclose(poses.positions[0], trials[0].positions[0], atol=1e-12)


def test_the_layout_names_topics_and_fields_that_are_there(made, contents):
    layout = json.loads((made[0] / "out.foxglove.json").read_text())
    panels, topics = layout["configById"], contents[0]
    placed: list[str] = []

    def walk(node) -> None:
        placed.append(node) if isinstance(node, str) else [walk(node[side]) for side in ("first", "second")]

    walk(layout["layout"])
    assert sorted(placed) == sorted(panels)
    assert set(panels["3D!arm"]["topics"]) | {panels["RosOut!trials"]["topicToRender"]} <= set(topics)
    paths = [path["value"] for panel in ("Plot!errors", "Plot!pulls") for path in panels[panel]["paths"]]
    assert len(paths) == 8
    for path in paths:
        topic, _, field = path.partition(".")
        assert hasattr(topics[topic][0][1], field), path


def test_a_session_without_tendons_has_no_commands_and_no_panel_for_them(made, tmp_path):
    root, trials = made
    words = [str(root / "arm.xml"), str(root / "session"), str(tmp_path / "out.mcap"), "--settings", str(root)]
    shutil.copytree(root / "session", tmp_path / "session")
    for trial in trials[:2]:
        trial.tendons, trial.commands, trial.tendon_positions = (), trial.commands[:, :0], trial.commands[:, :0]
    write_trials(tmp_path / "session", trials[:2])
    words[1] = str(tmp_path / "session")
    assert main([*words, "--trial", trials[1].name]) == 0
    with open(tmp_path / "out.mcap", "rb") as file:
        reader = make_reader(file)
        topics = {channel.topic for channel in reader.get_summary().channels.values()}
        assert [row.metadata["trial"] for row in reader.iter_metadata()] == [trials[1].name]
    assert not {"/commands_mm", "/pulls_mm"} & topics
    assert "Plot!pulls" not in (tmp_path / "out.foxglove.json").read_text()


@pytest.mark.parametrize(("name", "field"), [("unit_01", "unit_01"), ("rigid body 1", "rigid_body_1"), ("7", "n7"),
                                             ("é", "n_"), ("_a", "n_a")])  # fmt: skip
def test_names_of_bodies_become_names_of_fields(name, field):
    assert identifier(name) == field


def test_what_cannot_be_exported_is_one_line_and_leaves_no_file(made, tmp_path, capsys):
    root, trials = made
    (tmp_path / "there.mcap").write_bytes(b"of value")
    for out, more, expected in (
        ("there.mcap", [], "there.mcap: found a file, expected a name that is free and ends in .mcap"),
        ("out.bag", [], "out.bag: found another ending"),
        ("nowhere/out.mcap", [], "nowhere: found no such folder"),
        ("out.mcap", ["--trial", trials[0].name[:-1]], f"did you mean '{trials[0].name}'?"),
        ("out.mcap", ["--trial", "x"], f"--trial: found no trial 'x', expected one of {trials[0].name}, "),
    ):
        words = [str(root / "arm.xml"), str(root / "session"), str(tmp_path / out), "--settings", str(root)]
        assert main([*words, *more]) == 1
        assert expected in capsys.readouterr().err.splitlines()[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["there.mcap"]


def test_tensions_are_newtons_and_no_pulls(tmp_path):
    spec = forced_spec()
    model = spec.compile()
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    (tmp_path / "arm.xml").write_text(spec.to_xml())
    (tmp_path / "session").mkdir()
    write_trials(tmp_path / "session", [forced_pull(model, [6.0, 0, 0, 0], "test")])
    words = [str(tmp_path / name) for name in ("arm.xml", "session", "out.mcap")]
    assert main([*words, "--settings", str(tmp_path)]) == 0
    with open(tmp_path / "out.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        sent = {c.topic: message for _, c, _, message in reader.iter_decoded_messages()}
    assert sent["/commands_N"].tendon_1 == 6.0
    assert not {"/commands_mm", "/pulls_mm"} & sent.keys()
    panel = json.loads((tmp_path / "out.foxglove.json").read_text())["configById"]["Plot!pulls"]
    assert (panel["title"], panel["paths"][0]["value"]) == ("Tension, N", "/commands_N.tendon_1")
