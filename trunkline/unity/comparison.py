"""The models of a finished package beside the calibrated one, on the same curl."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pandas as pd

from trunkline.twin.package import MANIFEST
from trunkline.unity.assemble import Trajectory
from trunkline.unity.importer import as_imported
from trunkline.unity.linearize import Laws, compile_with
from trunkline.unity.manifest import Manifest
from trunkline.unity.roundtrip import curl, deviation, simulate
from trunkline.unity.unsupported import without_unsupported
from trunkline.unity.upm_package import MODEL


@dataclass
class Curled:
    """Models on a curl of T steps: time (T,) s; by model the tip (T, 3) m, by all but the first how far any body is
    from where the first has it, (T,) m."""

    time: np.ndarray
    tips: dict[str, np.ndarray]
    gaps: dict[str, np.ndarray]

    def table(self) -> pd.DataFrame:
        """Every tenth step: time (s), gaps (mm) and tips (m)."""
        columns = {"time": self.time} | {f"{name}_gap_mm": gap for name, gap in self.gaps_mm().items()}
        columns |= {f"{name}_{axis}": tip[:, "xyz".index(axis)] for name, tip in self.tips.items() for axis in "xyz"}
        return pd.DataFrame(columns)[::10]

    def gaps_mm(self) -> dict[str, np.ndarray]:
        return {name: 1e3 * gap for name, gap in self.gaps.items()}


def read_models(calibrated: str, packed: dict[str, bytes]) -> dict[str, mujoco.MjModel]:
    """Calibrated but for dead times and rubbing cables, packed, and as Unity imports it; in the latter two springs and
    dampers restored.

    Args:
        calibrated: MJCF. packed: the package's files by path.
    """
    mjcf, spec = packed[MODEL].decode(), mujoco.MjSpec.from_string(calibrated)
    without_unsupported(spec)
    described = Manifest.model_validate_json(packed[MANIFEST]).model
    laws = Laws(described.springs, described.dampers, described.diagonals)
    return {
        "calibrated": spec.compile(),
        "packed": compile_with(mjcf, laws),
        "imported": compile_with(as_imported(mjcf), laws),
    }


def curled(models: dict[str, mujoco.MjModel], trajectory: Trajectory) -> Curled:
    """The curl at the last gravity angle; the calibrated model is the first."""
    calibrated = models["calibrated"]
    commands = curl(calibrated, trajectory.duration, trajectory.pull)
    motions = {name: simulate(model, commands, trajectory.tilts[-1]) for name, model in models.items()}
    return Curled(
        time=calibrated.opt.timestep * np.arange(1, len(commands) + 1),
        tips={name: motion.tip for name, motion in motions.items()},
        gaps={name: deviation(motions["calibrated"], motions[name]) for name in ("packed", "imported")},
    )
