"""session.yaml: every mistake in one line that names file, key, what was found and what was expected."""

import numpy as np
import pytest
from omegaconf import OmegaConf

from trunkline.errors import InputError
from trunkline.recordings.session.session import FixedBase, read_session

GOOD = {
    "frame": {"up": [0, 2, 0]},
    "base": "base",
    "trials": [
        {"file": "tilt.mcap", "experiment": "static_tilt", "level": 30, "split": "identify"},
        {"file": "swing.mcap", "experiment": "release", "split": "validate", "window": [1, 2.5]},
    ],
}


def session(folder, content=GOOD, logs=("tilt.mcap", "swing.mcap")):
    folder.mkdir(exist_ok=True)
    for log in logs:
        (folder / log).touch()
    text = content if isinstance(content, str) else OmegaConf.to_yaml(content)
    (folder / "session.yaml").write_text(text)
    return folder


def changed(*path, value):
    content = OmegaConf.to_container(OmegaConf.create(GOOD))
    place = content
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return content


def test_good_session(tmp_path):
    read = read_session(session(tmp_path))
    assert [trial.name for trial in read.trials] == ["tilt", "swing"]
    np.testing.assert_allclose(read.frame.up_direction(), [0, 1, 0])
    assert read.clock == "stamp"
    assert [trial.load for trial in read.trials] == [0.0, 0.0]
    loaded = read_session(session(tmp_path, changed("trials", 0, "load", value=0.05)))
    assert [trial.load for trial in loaded.trials] == [0.05, 0.0]
    fixed = read_session(session(tmp_path, changed("base", value={"position": [0.1, 0, 0.1]})))
    assert isinstance(fixed.base, FixedBase)


@pytest.mark.parametrize(
    ("motor", "message"),
    [
        ({"unit": "deg", "tendons": {"tendon_1": 1}}, "motors.m1.*spool_radius: missing, expected that of a motor"),
        ({"unit": "mm", "spool_radius": 0.1, "tendons": {"tendon_1": 1}}, "spool_radius: found 0.1, expected none"),
        ({"unit": "inch", "tendons": {"tendon_1": 1}}, "motors.m1.unit: found 'inch', expected 'm', 'mm', .*'Nm' or"),
        ({"unit": "Nm", "tendons": {"tendon_1": 1}}, "spool_radius: missing, expected .* that counts Nm, m"),
        ({"unit": "N", "spool_radius": 0.1, "tendons": {"tendon_1": 1}}, "found 0.1, expected none .* that counts N"),
        ({"unit": "m", "tendons": {}}, "motors.m1.tendons: "),
    ],
)
def test_a_mistake_about_a_motor_is_named(tmp_path, motor, message):
    with pytest.raises(InputError, match=message):
        read_session(session(tmp_path, changed("motors", value={"m1": motor})))


@pytest.mark.parametrize(
    ("unit", "radius", "tension"), [("N", None, 4.0), ("Nm", 0.02, 200.0), ("effort", None, 4.0)]
)
def test_commands_as_forces_are_newtons_of_tension(tmp_path, unit, radius, tension):
    """A drum of 2 cm pulls by 200 N with 4 N m; an effort is N but for a factor."""
    motor = {"unit": unit, "tendons": {"tendon_2": 1, "tendon_1": 0.5}} | ({"spool_radius": radius} if radius else {})
    read = read_session(session(tmp_path, changed("motors", value={"m1": motor})))
    names, scale = read.coupling()
    assert names == ("tendon_2", "tendon_1")
    np.testing.assert_allclose(scale @ [4.0], [tension, tension / 2])
    assert read.command_unit == "N"
    assert read_session(session(tmp_path)).command_unit == "m"


FORCED = {"m1": {"unit": "N", "tendons": {"tendon_1": 1}}}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            changed("motors", value=FORCED | {"m2": {"unit": "mm", "tendons": {"tendon_2": 1}}}),
            r"motors.m2.unit: found 'mm', expected a unit of force \(N, Nm, effort\) as others have it",
        ),
        (
            changed("motors", value=FORCED) | {"topics": {"tendon_positions": "/states"}},
            "tendon_positions: found it of motors that are commanded by force, expected none",
        ),
        (
            changed("trials", 0, value={"file": "tilt.mcap", "experiment": "curl", "level": 20, "split": "identify"})
            | {"motors": FORCED},
            "trials.0.experiment: found a curl, whose level is in mm of pull, expected a motion",
        ),
    ],
)
def test_what_forces_exclude_is_named(tmp_path, content, message):
    with pytest.raises(InputError, match=message) as error:
        read_session(session(tmp_path, content))
    assert "\n" not in str(error.value)


def test_motors_and_tendons_exclude_each_other(tmp_path):
    content = changed("motors", value={"m1": {"unit": "m", "tendons": {"tendon_1": 1}}})
    with pytest.raises(InputError, match="motors: found it beside `tendons`, expected one of the two"):
        read_session(session(tmp_path, content | {"tendons": {"m1": "tendon_1"}}))


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (
            ("trials", 0, "file"),
            "tilt_.mcap",
            r"trials.0.file: found 'tilt_.mcap', expected .*such as tilt.mcap",
        ),
        (
            ("trials", 0, "experiment"),
            "tilt",
            r"trials.0.experiment: found 'tilt', expected 'static_tilt'",
        ),
        (
            ("trials", 0, "split"),
            "train",
            r"trials.0.split: found 'train', expected 'identify', 'validate' or 'test'",
        ),
        (
            ("trials", 0, "level"),
            None,
            r"trials.0: level: missing, expected the nominal level of a static_tilt",
        ),
        (("trials", 0, "level"), float("nan"), r"trials.0.level: found nan, expected a finite number"),
        (("trials", 0, "level"), True, r"trials.0.level: found true, expected a number"),
        (("trials", 0, "level"), 200, r"trials.0: level: found 200, expected 0 to 180, the degrees of tilt"),
        (
            ("trials", 0),
            {"file": "tilt.mcap", "experiment": "curl", "level": 0.02, "split": "identify"},
            r"trials.0: level: found 0.02, expected 1 to 10000, the mm of pull of a curl",
        ),
        (("trials", 1, "load"), 30, r"trials.1: load: found 30, expected 0 to 5, the kg at the tip of a release"),
        (("trials", 1, "load"), -1, r"trials.1: load: found -1, expected 0 to 5, the kg at the tip"),
        (("trials", 1, "load"), "30 g", r"trials.1.load: found '30 g', expected a valid number"),
        (("trials", 1, "load"), True, r"trials.1.load: found true, expected a number"),
        (("trials", 1, "load"), float("inf"), r"trials.1.load: found inf, expected a finite number"),
        (("trials", 1, "laod"), 0.1, r"trials.1.laod: unknown key, did you mean 'load'\?"),
        (
            ("trials", 1, "window"),
            [2, 1],
            r"trials.1: window: found \[2.0, 1.0\], expected \[start, end\]",
        ),
        (("trials", 1, "name"), "tilt", r"trials.1.name: found 'tilt' again, expected each name once"),
        (("trials", 1, "leevl"), 3, r"trials.1.leevl: unknown key, did you mean 'level'\?"),
        (("trials", 0, "experiment"), "relaese", r"trials.0.experiment: found 'relaese', .*did you mean 'release'\?"),
        (("frame", "up"), "y", r"frame.up: found 'y', expected a list of numbers, such as \[0, 1, 0\]"),
        (("base",), [0, 0, 0], r"base: found \[0, 0, 0\], expected a body's name, or \{position: \[x, y, z\]\}"),
        (("base",), {"positoin": [0, 0, 0]}, r"base.positoin: unknown key, did you mean 'position'\?"),
        (("trials",), [], r"trials: found \[\], expected"),
        (("frame", "up"), [0, 0, 0], r"frame: up: found the zero vector"),
        (("frame", "up"), [0, 1], r"frame.up.2: missing"),
        (("frame", "unit"), "feet", r"frame.unit: found 'feet', expected 'm', 'mm', 'cm' or 'inch'"),
        (("clock",), "utc", r"clock: found 'utc', expected 'stamp', 'log' or 'frame'"),
        (("tendons",), {"a": "t", "b": "t"}, r"tendons: found 't' twice, expected each name"),
        (("base",), {"position": [0, 0, 0], "quaternion": [0, 0, 0, 0]}, r"base.*: quaternion: found norm zero"),
        (("base",), {"position": [0, 0], "quaternion": [1, 0, 0, 0]}, r"base"),
    ],
)
def test_mistakes(tmp_path, path, value, message):
    with pytest.raises(InputError, match=r"session\.yaml: " + message):
        read_session(session(tmp_path, changed(*path, value=value)))


def test_missing_keys_and_files(tmp_path):
    with pytest.raises(InputError, match="nowhere: no such folder"):
        read_session(tmp_path / "nowhere")
    session(tmp_path / "arm_7")
    with pytest.raises(InputError, match=r"nowhere: no such folder, .*; found arm_7"):
        read_session(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="empty: found 0 logs and no session.yaml"):
        read_session(tmp_path / "empty")
    with pytest.raises(InputError, match="expected one of the folder's 0 logs"):
        read_session(session(tmp_path / "nologs", logs=()))
    with pytest.raises(InputError, match=r"session.yaml: frame: missing.*\(and 1 more\)"):
        read_session(session(tmp_path / "bare", {"base": "base"}))
    with pytest.raises(InputError, match="session.yaml: not readable as YAML"):
        read_session(session(tmp_path / "broken", "trials: [\n"))
    with pytest.raises(InputError, match="session.yaml: found a list, expected `key: value` lines"):
        read_session(session(tmp_path / "list", "[1, 2]"))
