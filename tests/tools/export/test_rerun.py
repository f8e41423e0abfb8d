"""Rerun's SDK reads an exported file untouched: bodies as transforms and as points, numbers, and lines of text."""

import numpy as np
import pytest

from tests.tools.export.test_export import UNSEEN, contents, made  # noqa: F401

AXES = ("x", "y", "z")


@pytest.fixture(scope="module")
def read(made):  # noqa: F811
    """What Rerun makes of each topic: its components, by name, as rows with their times in s."""
    rerun = pytest.importorskip("rerun.chunk", reason="no rerun, the SDK of a viewer: the extra `rerun` has it")
    entities: dict[str, dict[str, list]] = {}
    for chunk in rerun.McapReader(made[0] / "out.mcap").stream():
        batch = chunk.to_record_batch()
        times = [None] if chunk.is_static else 1e-9 * batch.column("message_log_time").cast("int64").to_numpy()
        for name in batch.schema.names:
            if ":" in name or chunk.entity_path == "/__mcap_metadata":
                rows = zip(times, batch.column(name).to_pylist(), strict=True)
                entities.setdefault(chunk.entity_path, {}).setdefault(name, []).extend(rows)
    return entities


def test_every_topic_is_there_and_none_as_bytes_alone(read, contents):  # noqa: F811
    topics, metadata = contents
    assert set(topics) == {entity for entity in read if not entity.startswith("/__mcap")}
    for topic in topics:
        components = {name.partition(":")[0] for name in read[topic]} - {"McapChannel", "McapSchema"}
        assert components & {"Transform3D", "Points3D", "TextLog", "trunkline.Errors", "trunkline.Pulls",
                             "foxglove.SceneUpdate"}, components  # fmt: skip
    records = {name: rows[0][1][0] for name, rows in read["/__mcap_metadata"].items() if name.startswith("trial ")}
    as_pairs = [{pair["first"]: pair["second"] for pair in pairs} for pairs in records.values()]
    assert sorted(as_pairs, key=lambda row: row["trial"]) == sorted(metadata, key=lambda row: row["trial"])


@pytest.mark.parametrize("name", ["measured", "simulated"])
def test_bodies_are_transforms_and_points_where_they_were(read, contents, name):  # noqa: F811
    topics, _ = contents
    links = [(time, link) for time, message in topics[f"/{name}/tf"] for link in message.transforms]
    entity = read[f"/{name}/tf"]
    for component, expected in (
        ("child_frame", [link.child_frame_id for _, link in links]),
        ("parent_frame", ["base"] * len(links)),
    ):
        assert [row[0] for _, row in entity[f"Transform3D:{component}"]] == expected
    moved = entity["Transform3D:translation"]
    np.testing.assert_allclose([time for time, _ in moved], [time for time, _ in links], atol=1e-9)
    places = [[getattr(link.translation, axis) for axis in AXES] for _, link in links]
    np.testing.assert_allclose([row[0] for _, row in moved], places, atol=1e-7)
    turns = [[getattr(link.rotation, axis) for axis in (*AXES, "w")] for _, link in links]
    np.testing.assert_allclose([row[0] for _, row in entity["Transform3D:quaternion"]], turns, atol=1e-7)
    points = read[f"/{name}/points"]["Points3D:positions"]
    assert [row for _, row in read[f"/{name}/points"]["CoordinateFrame:frame"]] == [["base"]] * len(points)
    frames = {time: [link.translation for link in message.transforms] for time, message in topics[f"/{name}/tf"]}
    for time, row in points:
        (bodies,) = [frame for moment, frame in frames.items() if abs(moment - time) < 1e-6]
        np.testing.assert_allclose(row, [[getattr(place, axis) for axis in AXES] for place in bodies], atol=1e-7)


def test_errors_commands_and_pulls_are_numbers_by_name_and_trials_are_lines(read, contents):  # noqa: F811
    topics, _ = contents
    for topic, component in (("/errors_mm", "trunkline.Errors"), ("/commands_mm", "trunkline.Pulls"),
                             ("/pulls_mm", "trunkline.Pulls")):  # fmt: skip
        rows = [row[0] for _, row in read[topic][f"{component}:message"]]
        for field in (field.name for field in topics[topic][0][1].DESCRIPTOR.fields):
            expected = [getattr(message, field) for _, message in topics[topic]]
            np.testing.assert_array_equal([row[field] for row in rows], expected)
    unseen = [row for _, row in read["/errors_mm"]["trunkline.Errors:message"] if np.isnan(row[0]["unit_02"])]
    assert len(unseen) == UNSEEN.stop - UNSEEN.start
    assert [row[0] for _, row in read["/trial"]["TextLog:text"]] == [message.message for _, message in topics["/trial"]]
