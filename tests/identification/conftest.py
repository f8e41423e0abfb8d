"""What the tests of this room share."""

import pytest


@pytest.fixture(autouse=True)
def few_resamplings(request, monkeypatch):
    """The bootstrap of 20,000 is half of a small fit. tests/identification/test_intervals.py tries it as it is."""
    if request.path.name != "test_intervals.py":
        monkeypatch.setattr("trunkline.identification.fit.intervals.RESAMPLINGS", 2000)
