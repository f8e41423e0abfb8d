"""Tests that need the same slow thing go to one worker of `pytest --dist loadgroup`, so that it is made once."""

import pytest

# Folders whose tests run the kernels of trunkline.statics. To compile them takes more than a minute the first time,
# and every worker that needs them before the first has written them to the cache compiles them too.
KERNELS = ("ik", "reachability", "statics")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.parent.name in KERNELS and not item.get_closest_marker("xdist_group"):
            item.add_marker(pytest.mark.xdist_group("kernels"))
