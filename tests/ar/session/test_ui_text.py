"""The next action in words: by controllers, and by the keys that the page has."""

from pathlib import Path
from typing import get_args

import pytest

from trunkline.ar.session.ui_text import next_action, next_key
from trunkline.ar.teleop.messages import Mode

PAGE = Path(__file__).parents[3] / "client/src/index.html"


@pytest.mark.parametrize("mode", get_args(Mode))
def test_whoever_has_a_keyboard_is_told_of_no_controller(mode):
    for holder in ("", "somebody"):
        for touched in ((False, False), (True, False), (True, True)):
            action = next_key(mode, None, holder, touched)
            assert action
            assert not any(word in action for word in ("trigger", "grip", "primary", "ray", "stick"))
            assert next_action(mode, None, holder, True, touched)


def test_what_lacks_is_named_as_the_page_names_it():
    assert next_key("aim", None, "me", (False, True)).startswith("drag the mount’s marker")
    assert next_key("aim", None, "me", (False, False)).startswith("drag the mount’s and the tip’s marker")
    listed = PAGE.read_text(encoding="utf-8")
    for key in ("Enter", "G", "R", "F"):
        assert f"<kbd>{key}</kbd>" in listed
