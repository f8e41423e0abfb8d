"""What counts as code that a result goes through, by hand."""

import pytest

from upkeep.origin import imported


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("trunkline/frames.py", True),
        ("trunkline/errors.py", False),  # words
        ("trunkline/report/figures/maps.py", False),  # pictures
        ("upkeep/gate.py", False),  # what is done with it afterwards
        ("trunkline/pipeline/identify.py", True),  # but this is part of it
    ],
)
def test_of_what_is_imported_all_counts_but_what_changes_no_number(tmp_path, name, counts):
    files = {
        name: "import trunkline.model.statics\n",
        "trunkline/model/statics.py": "LENGTH = 1\n",
        "studies/some.py": "",
    }
    files["studies/some.py"] = f"import {name.removesuffix('.py').replace('/', '.')}\n"
    for file, text in files.items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text)
    files = imported(tmp_path, ["studies/some.py"])
    assert files == {"studies/some.py"} | ({name, "trunkline/model/statics.py"} if counts else set())
