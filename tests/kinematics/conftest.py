"""The arm of these tests: the first units of the spiral."""

import pytest

from tests.support.bent_chain import stump
from trunkline.model.statics.chain import read_chain


@pytest.fixture(scope="module")
def model():
    return stump()


@pytest.fixture(scope="module")
def chain(model):
    return read_chain(model)
