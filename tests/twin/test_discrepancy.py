"""What the model lacks goes with the twin: from the artifacts, and from a package made of them."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from tests.support.residual import everywhere
from tests.unity.test_assemble import LABEL, ROBOT, TRAJECTORY, sources  # noqa: F401
from trunkline.errors import InputError
from trunkline.files import file_digest
from trunkline.twin.discrepancy import FILE, Discrepancy, Lacking, read_lacking
from trunkline.twin.twin import Twin
from trunkline.unity.assemble import assemble

SCALES = np.array([[0.002, 0.01, 0.0612345678], [0.004, 0.02, 0.03]])


def lacking(model: str) -> Lacking:
    return Lacking(model, Discrepancy(SCALES, 16), 60.0, 10.0, 0.04, 0.05, 0.03)


def test_the_package_has_it_as_the_artifacts_have(sources, tmp_path):  # noqa: F811
    folder = tmp_path / "identify_control"
    folder.mkdir()
    (folder / "arm.xml").write_text(sources.mjcf)
    model = file_digest(folder / "arm.xml")
    (tmp_path / FILE).parent.mkdir()
    (tmp_path / FILE).write_text(json.dumps(lacking(model).table()))
    files, _ = assemble(LABEL, replace(sources, lacking=json.loads((tmp_path / FILE).read_text())), TRAJECTORY, ROBOT)
    packed = Twin.of_package(files).lacking
    assert packed is not None
    assert packed.discrepancy.trials == 16
    np.testing.assert_allclose(packed.discrepancy.scales, SCALES, rtol=1e-6)
    assert replace(packed, discrepancy=lacking(model).discrepancy).table() == lacking(model).table()
    there = read_lacking(tmp_path / FILE, model)
    assert there is not None
    assert there.table() == packed.table()


def test_a_residual_map_goes_with_it(sources):  # noqa: F811
    model = hashlib.sha256(sources.mjcf.encode()).hexdigest()
    rest = Discrepancy(SCALES / 2, 20)
    learnt = replace(lacking(model), residual_map=everywhere([0.001, 0.002, -0.003]), left=rest)
    table = json.loads(json.dumps(learnt.table()))
    files, _ = assemble(LABEL, replace(sources, lacking=table), TRAJECTORY, ROBOT)
    packed = Twin.of_package(files).lacking
    assert packed is not None
    assert packed.residual_map is not None
    assert packed.residual_map.table() == everywhere([0.001, 0.002, -0.003]).table()
    assert packed.left is not None
    np.testing.assert_allclose(packed.left.scales, SCALES / 2, rtol=1e-5)
    with pytest.raises(InputError, match=r"^file: .*residual map.*expected what the stage report writes"):
        Lacking.from_table(table | {"residual_map": table["residual_map"] | {"numbers": [1.0]}}, model, "file")


def test_a_package_and_artifacts_without_it_load_and_know_nothing_of_it(sources, tmp_path):  # noqa: F811
    files, _ = assemble(LABEL, sources, TRAJECTORY, ROBOT)
    assert b"lacking" not in files["Runtime/Model/parameters.json"]
    assert Twin.of_package(files).lacking is None
    assert read_lacking(tmp_path / FILE, "model") is None


@pytest.mark.parametrize("table", [{}, None, lacking("of another model").table()])
def test_what_is_of_no_trials_or_another_model_is_none(table):
    assert Lacking.from_table(table, "model", "file") is None


@pytest.mark.parametrize("change", [{"scales": [[1.0, 2.0]]}, {"scales": "all"}, {"conditions": {}}, {"trials": None}])
def test_a_damaged_table_is_one_line(change):
    with pytest.raises(InputError, match=r"^file: .*expected what the stage report writes"):
        Lacking.from_table(lacking("model").table() | change, "model", "file")


def test_a_damaged_file_is_one_line(tmp_path):
    (tmp_path / "discrepancy.json").write_text("{")
    with pytest.raises(InputError, match=r"discrepancy\.json: .*expected what the stage report writes"):
        read_lacking(tmp_path / "discrepancy.json", "model")


@pytest.mark.parametrize(("pulls", "tilt", "beyond"), [
    ([0.0, 0.0], 60.0, ""), ([0.0, 0.0], 62.0, "mount tilted by 62°, trials up to 60°"), ([0.039, 0.0], 10.0, ""),
    ([0.039, 0.0], 12.0, "mount tilted by 12°, trials with pulls up to 10°"), ([0.025, 0.0249], 0.0, ""),
    ([0.045, 0.0], 0.0, "a motor pulls 45.0 mm, in trials up to 40.0 mm"),
    ([0.025, 0.0251], 0.0, "motors pull 50.1 mm together, in trials up to 50.0 mm"),
])  # fmt: skip
def test_beyond_what_trials_went_up_to_the_number_is_named(pulls, tilt, beyond):
    assert lacking("model").beyond(np.array(pulls), tilt) == beyond
