"""Several workers: a file's tests share one, and so do all that run the kernels of the statics."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]
TEST = """
import os, pathlib, pytest

@pytest.mark.parametrize("number", range(4))
def test_who_runs_this(number):
    with (pathlib.Path(__file__).parents[1] / "workers.txt").open("a") as seen:
        seen.write(f"{pathlib.Path(__file__).parent.name} {os.environ['PYTEST_XDIST_WORKER']}\\n")
"""


def test_a_file_runs_in_one_worker_and_so_do_all_that_compile(tmp_path):
    shutil.copy(TESTS / "conftest.py", tmp_path)
    for folder in ("arm", "ik", "statics", "takes"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"test_{folder}.py").write_text(TEST)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "xdist", "-n", "2", "--dist", "loadgroup", str(tmp_path)]
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    alone = clean | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(command, cwd=tmp_path, env=alone, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    ran = [line.split() for line in (tmp_path / "workers.txt").read_text().splitlines()]
    assert len(ran) == 16
    workers = {folder: {worker for where, worker in ran if where == folder} for folder, _ in ran}
    assert {len(some) for some in workers.values()} == {1}
    assert workers["ik"] == workers["statics"]
    assert len({worker for _, worker in ran}) == 2
