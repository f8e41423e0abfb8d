"""Small packages of balls, with shared vectors and without, and the one that the stage made last."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.folders import package
from tests.support.operator import config
from tests.support.small_arm import small_spec
from tests.unity.test_assemble import LABEL, ROBOT, TRAJECTORY, grids, sheets_of_a_ball, sources_in
from trunkline.ar.conformance.vectors import with_shared_vectors
from trunkline.model.arm.joints import Joints, MaxwellElement, add_elements
from trunkline.twin.package import read_tarball
from trunkline.unity.assemble import assemble


@pytest.fixture(scope="session")
def assembled(tmp_path_factory) -> dict[str, bytes]:
    files, violations = assemble(LABEL, sources_in(tmp_path_factory.mktemp("assembled")), TRAJECTORY, ROBOT)
    assert violations == []
    return files


@pytest.fixture(scope="session")
def plain(tmp_path_factory):
    """Of sheets, under gravity from any side."""
    sources = sources_in(tmp_path_factory.mktemp("balls"))
    np.savez(sources.grids, **grids(), **sheets_of_a_ball().arrays())
    files, violations = assemble(LABEL, sources, TRAJECTORY, ROBOT)
    assert violations == []
    return files


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


@pytest.fixture(scope="session")
def plain_answered(plain):
    """With its shared vectors, which take longer to make than all else."""
    return with_shared_vectors(plain, config().core)


@pytest.fixture(scope="session")
def of_one_tilt_answered(of_one_tilt):
    return with_shared_vectors(of_one_tilt, config().core)


@pytest.fixture(scope="session", params=["plain", "of_one_tilt", "built"])
def files(request):
    """Packages with shared vectors."""
    if request.param != "built":
        return request.getfixturevalue(f"{request.param}_answered")
    return read_tarball(package())


@pytest.fixture(scope="session")
def arm_files(tmp_path_factory):
    """Of an arm of joints that creep, are round and harden, with friction on its tendons."""
    spec = small_spec(max_force=20)
    for joint in spec.joints:
        joint.stiffness = [2 * joint.stiffness[0], 0, 2 * joint.stiffness[0]]
    branches = [MaxwellElement(0.2, 0.5), MaxwellElement(0.1, 0.05), MaxwellElement(0.05, 5.0)]
    add_elements(spec, Joints(branches, round=True), 1e-5)
    spec.compile()
    sources = replace(sources_in(tmp_path_factory.mktemp("start")), mjcf=spec.to_xml())
    files, violations = assemble(LABEL, sources, TRAJECTORY, ROBOT)
    assert violations == []
    return files
