"""What another process or thread makes come true, some time."""

import time

SOON = 10.0  # s


def until(happens, each=lambda: None, seconds=SOON):
    """Until `happens()`, `each` being called meanwhile."""
    end = time.monotonic() + seconds
    while not happens():
        assert time.monotonic() < end, "it did not happen"
        each()
        time.sleep(0.001)
