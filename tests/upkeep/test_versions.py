"""versions.yaml: of the libraries that results depend on, the locked versions."""

from pathlib import Path

import pytest
import yaml

from trunkline.errors import InputError
from upkeep import versions

ROOT = Path(__file__).parents[2]


@pytest.fixture
def project(tmp_path):
    for name in (*versions.LOCKS, versions.FILE):
        (tmp_path / name).write_text((ROOT / name).read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "dvc.yaml").touch()
    return tmp_path


def test_the_file_is_current(project):
    assert versions.main(project) == 0
    current = (project / versions.FILE).read_text()
    assert (ROOT / versions.FILE).read_text() == current, "run `python -m upkeep.versions`"


def test_the_installed_libraries_are_those_it_names():
    assert versions.installed_otherwise(ROOT) == []


def test_a_newer_mujoco_in_the_lock_changes_its_version_and_no_other(project):
    before = yaml.safe_load((project / versions.FILE).read_text())
    lock = (project / "requirements.lock").read_text()
    changed = lock.replace("mujoco==4.0.0", "mujoco==4.0.1").replace("pytest==", "pytest==99")
    assert changed != lock
    (project / "requirements.lock").write_text(changed)
    assert versions.main(project) == 0
    assert yaml.safe_load((project / versions.FILE).read_text()) == before | {"mujoco": "4.0.1"}
    assert versions.installed_otherwise(project) == ["mujoco: installed 4.0.0, versions.yaml names 4.0.1"]


def test_a_library_that_is_not_locked_is_named(project, capsys):
    lock = (project / "requirements.lock").read_text()
    (project / "requirements.lock").write_text(lock.replace("\nscipy==", "\nanother=="))
    with pytest.raises(InputError, match="found no scipy==…"):
        versions.locked_versions(project)
    assert versions.main(project) == 1
