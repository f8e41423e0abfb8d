"""A twin comes from a folder of artifacts, from a model with its tables, and from a package, the same each time."""

import copy
import json
import shutil

import numpy as np
import pytest

from tests.support.folders import TABLE_OF_NOTHING, package
from trunkline.errors import InputError
from trunkline.identification.stages import read_table
from trunkline.twin.package import read_tarball
from trunkline.twin.posterior import Posterior
from trunkline.twin.twin import Twin


def same(first: Posterior, other: Posterior) -> bool:
    return first.names == other.names and all(
        np.array_equal(getattr(first, name), getattr(other, name))
        for name in ("estimate", "deviation", "degrees", "correlation", "low", "high")
    )


@pytest.fixture(scope="module")
def artifacts():
    return package().parents[1]


def test_a_folder_of_artifacts_and_its_last_model_are_one_twin(artifacts):
    twin, alone = Twin.load(artifacts), Twin.load(artifacts / "identify_control/arm.xml")
    assert twin.provenance == alone.provenance
    assert list(twin.provenance.tables) == ["identify_stiffness", "identify_damping", "identify_control"]
    assert list(twin.provenance.files)[0] == (artifacts / "identify_control/arm.xml").as_posix()
    assert twin.arm.model.nu > 0
    assert "kp" in twin.posterior.names
    assert same(twin.posterior, alone.posterior)


def test_an_earlier_model_knows_no_later_table(artifacts):
    assert list(Twin.load(artifacts / "identify_damping/arm.xml").provenance.tables) == [
        "identify_stiffness", "identify_damping"
    ]  # fmt: skip


@pytest.mark.parametrize("stage", ["identify_damping", "identify_control"])
def test_a_stage_that_ran_without_a_table_is_refused(stage, artifacts, tmp_path):
    """Else what it identified would count as known to the last digit."""
    for name in ("identify_stiffness", "identify_damping", "identify_control"):
        shutil.copytree(artifacts / name, tmp_path / name)
    (tmp_path / stage / "parameters.json").unlink()
    with pytest.raises(InputError, match=f"{stage}/parameters.json"):
        Twin.load(tmp_path)


def test_in_a_stage_s_own_folder_its_model_knows_the_tables_before_it(artifacts, monkeypatch):
    there = Twin.load(artifacts / "identify_control/arm.xml")
    monkeypatch.chdir(artifacts / "identify_control")
    here = Twin.load("arm.xml")
    assert list(here.provenance.tables) == list(there.provenance.tables)
    assert here.provenance.fitted_to == there.provenance.fitted_to
    assert here.provenance.digest == there.provenance.digest
    assert same(here.posterior, there.posterior)


def test_a_package_has_the_same_posterior_packed_and_unpacked(artifacts, tmp_path):
    files = read_tarball(package())
    for path, data in files.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_bytes(data)
    packed, unpacked, made_of = Twin.load(package()), Twin.load(tmp_path), Twin.load(artifacts)
    assert same(packed.posterior, made_of.posterior)
    assert same(unpacked.posterior, made_of.posterior)
    assert packed.provenance == unpacked.provenance
    assert packed.provenance.package
    assert packed.provenance.digest == made_of.provenance.digest
    assert packed.provenance.fitted_to == made_of.provenance.fitted_to


@pytest.mark.parametrize("damaged", ["Runtime/Model/parameters.json", "Runtime/Model/calibrated.xml"])
def test_a_damaged_package_is_one_line(damaged):
    with pytest.raises(InputError, match=f"{damaged}: found sha256"):
        Twin.of_package(read_tarball(package()) | {damaged: b"{"})
    files = {path: data for path, data in read_tarball(package()).items() if path != damaged}
    with pytest.raises(InputError, match=f"{damaged}: found sha256 none"):
        Twin.of_package(files)


def test_a_model_that_no_stage_identified_leaves_nothing_open(artifacts, tmp_path):
    shutil.copy(artifacts / "identify_control/arm.xml", tmp_path / "arm.xml")
    twin = Twin.load(tmp_path / "arm.xml")
    assert twin.posterior.names == []
    assert twin.provenance.tables == twin.provenance.fitted_to == {}


def test_a_folder_without_any_is_one_line(tmp_path):
    with pytest.raises(InputError, match="found no identify_stiffness/arm.xml"):
        Twin.load(tmp_path)


@pytest.mark.parametrize("key", ["parameters", "fitted_to", "compared", "frames"])
def test_a_table_without_what_its_readers_need_is_refused(key, tmp_path):
    table = copy.deepcopy(TABLE_OF_NOTHING)
    table["compared" if key == "frames" else key] = {} if key == "frames" else None
    (tmp_path / "parameters.json").write_text(json.dumps(table))
    with pytest.raises(InputError, match=r"parameters\.json: .*expected what a stage of identification writes"):
        read_table(tmp_path / "parameters.json")
