"""The settings of a live session: conf/live, and files of the release before."""

from pathlib import Path

import pytest

from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.session.settings import read_session_config
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT

TEXT = (PROJECT / "conf/live/config.yaml").read_text(encoding="utf-8")
OLD = TEXT.replace("\nobstacles:", "\nboxes:").replace("\nobject:", "\nthing:")


def written(folder: Path, text: str) -> Path:
    (folder / "config.yaml").write_text(text, encoding="utf-8")
    return folder


def test_keys_of_the_release_before_are_read_and_named(tmp_path, capsys):
    assert read_session_config(written(tmp_path, OLD)) == read_session_config()
    assert capsys.readouterr().out == "".join(
        f"{tmp_path}: `{old}` is called `{new}` now: please rename it, the next release reads `{new}` alone\n"
        for old, new in (("boxes", "obstacles"), ("thing", "object"))
    )


def test_corrections_have_the_same_bounds_in_a_session_as_where_they_are_scored():
    assert read_session_config().correction == CorrectionSettings()


def test_a_key_under_both_names_is_refused(tmp_path):
    with pytest.raises(InputError, match="`boxes` beside `obstacles`"):
        read_session_config(written(tmp_path, TEXT + "\nboxes: []\n"))
