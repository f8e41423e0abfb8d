"""A session that cannot be made leaves no process behind."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.live import live
from tests.support.operator import config
from trunkline.ar.session import composition
from trunkline.ar.session.log_format import Subject
from trunkline.errors import InputError

CLOSED = {  # by what fails: what was begun before, closed in the reverse order
    "scene": ["previewer"],
    "cameras": ["cameras", "previewer"],
    "new_path": ["cameras", "previewer"],
    "robot_of": ["log_writer", "cameras", "previewer"],
    "Teleoperation": ["robot", "log_writer", "cameras", "previewer"],
    "certificate_of": ["robot", "log_writer", "cameras", "previewer"],
    "": [],
}


class Cameras:
    names, sees_mount = ("base", "tip"), False

    def __init__(self, closed, fails):
        self._closed, self._fails = closed, fails

    def connect(self):
        if self._fails:
            raise KeyboardInterrupt

    def close(self):
        self._closed.append("cameras")


@pytest.mark.parametrize("fails", CLOSED)
def test_where_a_session_is_not_made_all_that_has_begun_is_closed(monkeypatch, tmp_path, fails):
    closed = []

    def begun(name):
        return SimpleNamespace(close=lambda: closed.append(name), event=None, await_begun=lambda: None)

    simulation = SimpleNamespace(bodies=("base",), twin=SimpleNamespace(model=None))
    package = SimpleNamespace(files={}, geometry=SimpleNamespace(length=0.3), reach=None, digest="p", period=0.1)
    stubs = {
        "read_package": package,
        "simulation_of": simulation,
        "PreviewProcess": begun("previewer"),
        "scene": {},
        "subject_of": (subject := Subject(("base",), (), (), np.zeros(3), ("base", (0.0, 0.0, 0.0)), "")),
        "measured_subject": subject,
        "real_cameras": Cameras(closed, fails == "cameras"),
        "new_path": tmp_path / "log.mcap",
        "LogWriterProcess": begun("log_writer"),
        "robot_of": begun("robot"),
        "Teleoperation": None,
        "SessionController": SimpleNamespace(begin=lambda rate, version: None),
        "certificate_of": b"",
    }

    def stub(name):
        def called(*_, **__):
            if name == fails:
                raise InputError(name)
            return stubs[name]

        return called

    for name in stubs:
        monkeypatch.setattr(composition, name, stub(name))
    monkeypatch.setattr(composition.unpacked, "maps_of", lambda files: {})
    monkeypatch.setattr(composition.Shells, "of", lambda maps: None)
    make = lambda: composition.make(tmp_path, config(), live(), None, "natnet")  # noqa: E731
    if fails:
        with pytest.raises((InputError, KeyboardInterrupt)):
            make()
    else:
        assert make().cameras.names == Cameras.names
    assert closed == CLOSED[fails]
