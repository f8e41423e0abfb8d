"""Small packages of balls, with shared vectors and without, and the one that the stage made last."""

import numpy as np
import pytest

from tests.support.folders import package
from tests.support.operator import config
from tests.unity.test_assemble import LABEL, ROBOT, TRAJECTORY, grids, sheets_of_a_ball, sources_in
from trunkline.ar.conformance.vectors import with_shared_vectors
from trunkline.twin.package import read_tarball
from trunkline.unity.assemble import assemble


@pytest.fixture(scope="session")
def plain(tmp_path_factory):
    """Of sheets, under gravity from any side."""
    sources = sources_in(tmp_path_factory.mktemp("balls"))
    np.savez(sources.grids, **grids(), **sheets_of_a_ball().arrays())
    return assemble(LABEL, sources, TRAJECTORY, ROBOT)[0]


@pytest.fixture(scope="session")
def of_one_tilt(tmp_path_factory):
    """The same with maps of the paper's gravity alone."""
    sources = sources_in(tmp_path_factory.mktemp("one_tilt"))
    axis = np.linspace(-0.8, 0.8, 17)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    soft = np.linalg.norm(points - [0, 0, -0.3], axis=-1) - 0.2
    arrays = {"soft_030": soft, "soft_035": soft - 0.02, "rigid": np.linalg.norm(points - 0.4, axis=-1) - 0.3}
    np.savez(sources.grids, **grids() | arrays | {"origin": np.full(3, -0.8), "spacing": np.full(3, 0.1)})
    return assemble(LABEL, sources, TRAJECTORY, ROBOT)[0]


@pytest.fixture(scope="session", params=["plain", "of_one_tilt", "built"])
def files(request):
    """Packages with shared vectors."""
    if request.param != "built":
        return with_shared_vectors(request.getfixturevalue(request.param), config().core)
    return read_tarball(package())
