"""What the earlier stages wrote, gathered for the package."""

import json
from pathlib import Path

from trunkline.errors import InputError, existing
from trunkline.identification.stages import MODEL, TABLE, read_table
from trunkline.identification.stages import STAGES as IDENTIFYING
from trunkline.twin.discrepancy import FILE, read_discrepancy_table
from trunkline.unity.assemble import Sources
from trunkline.version import __version__

STAGES = ("ingest", "filter", "build_mjcf", *IDENTIFYING, "fk_dataset", "train_ik", "reachability")


def read_sources(root: Path) -> Sources:
    """The finished artifacts of the pipeline in `root`.

    Raises:
        InputError: a file is missing.
    """
    artifacts = root / "artifacts"
    meshes = sorted((artifacts / "reachability/meshes").glob("*.obj"))
    if not meshes:
        place = f"{artifacts}/reachability/meshes: found no mesh"
        raise InputError(f"{place}, expected .obj files (run the reachability stage)")
    return Sources(
        mjcf=existing(artifacts / IDENTIFYING[-1] / MODEL).read_text(),
        tables={stage: read_table(artifacts / stage / TABLE) for stage in IDENTIFYING},
        network=existing(artifacts / "train_ik/ik.onnx"),
        meshes=meshes,
        grids=existing(artifacts / "reachability/grids.npz"),
        metrics={s: json.loads(existing(artifacts / s / "metrics.json").read_text()) for s in STAGES},
        texts={
            "README.md": existing(root / "docs/unity.md").read_bytes(),
            "LICENSE.md": existing(root / "LICENSE").read_bytes(),
            "CHANGELOG.md": existing(root / "trunkline/unity/CHANGELOG.md").read_bytes(),
        },
        trunkline=__version__,
        lacking=read_discrepancy_table(artifacts / FILE),
    )
