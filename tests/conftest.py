"""Tests of one file go to one worker of pytest-xdist, so that what they share is made once.

Marks `xdist_group` would be the way to say so, but pytest 9.2 hides them from xdist 3.8, which then spreads
every file over all workers, so that each of them makes every fixture and compiles every kernel for itself.
"""

import os
import sys
from pathlib import Path, PurePosixPath

import pytest

from tests.support.skips import Skips, read_rows

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as in `stages`

# Files and folders whose tests run the kernels of trunkline.model.statics. To compile them takes most of a minute the
# first time, in every worker that needs them before the first has written them to the cache. So these share a worker.
KERNELS = ("ik", "reachability", "statics", "test_capstan.py", "test_library.py", "test_scheduler.py")


def pytest_configure(config):
    config.pluginmanager.register(Skips(read_rows(Path(__file__).with_name("skips.yaml"))))
    if not config.pluginmanager.hasplugin("xdist"):
        return
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = PurePosixPath(nodeid.partition("::")[0])
            return "kernels" if {file.name, file.parent.name} & set(KERNELS) else str(file)

    class Workers:
        @pytest.hookimpl
        def pytest_xdist_make_scheduler(self, config, log):
            return ByFile(config, log)

    config.pluginmanager.register(Workers())


def pytest_collection_finish():
    """Figures are drawn whole, but where their parts lie is not sought: most of the time, and nobody looks. The demo in
    little draws them laid out."""
    if "trunkline.report.figures.style" in sys.modules:
        sys.modules["matplotlib"].rcParams["figure.constrained_layout.use"] = False
