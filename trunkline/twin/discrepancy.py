"""What the model lacks of the tip at rest: how large it may be, and draws of it.

No interval of a parameter holds it. The tip is off by a vector d across the arm, in both directions alike, with a
variance of

    v² = s_0² + s_g² g² + s_p² p²,

g how far gravity moves the tip and p how far the cables do. The constant s_0 is there because a model is off also
where its tip hardly moves: the rest shape, the place of the mount, the first millimetres of a pull. The three scales
are not known exactly; `trunkline/report/certificate/discrepancy.py` infers them from held-out trials.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.kinematics.residual.residual_map import ResidualMap
from trunkline.recordings.trials.conditions import PULLED

FILE = Path("report/discrepancy.json")  # in a folder of artifacts
UNITS = {"scales": ["m", "1", "1"], "tilt_deg": "deg", "pulled_tilt_deg": "deg", "pull": "m", "pulls": "m",
         "sure_pulls": "m", "load": "kg",
         "residual_map": {"pulls": "m", "gravity": "m/s^2", "residuals": "m"}}  # fmt: skip
SAME_TILT = 1e-6  # deg, of rounding
SURE = 0.01  # of the arm's length: a tip that may be further off is worth a warning
DIGITS = 6  # of a scale; trials leave each open by far more


@dataclass(frozen=True)
class Discrepancy:
    """scales: s_0, m, s_g and s_p, triples that are equally likely. Shape (S, 3). trials: they are inferred from."""

    scales: np.ndarray
    trials: int

    @property
    def rms(self) -> np.ndarray:
        """√E[s²] of each. Shape (3,)."""
        return np.sqrt(np.mean(self.scales**2, axis=0))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Triples s_0, s_g, s_p. Shape (count, 3)."""
        return self.scales[rng.integers(len(self.scales), size=count)]

    def deviation(self, ways: np.ndarray) -> np.ndarray:
        """Root mean square length of d, m, from g and p, m, of shape (N, 2). Shape (N,)."""
        return np.sqrt(lengths_of(ways) ** 2 @ self.rms**2)

    def offsets(self, ways: np.ndarray, arms: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draws of d, m, across the lines from the mount to the tips. Shape (count, N, 3).

        Args:
            ways: g and p, m. Shape (N, 2). arms: from the mount to the tip. Shape (N, 3).
        """
        scales = self.draw(count, rng)
        deviation = np.sqrt(scales**2 @ (lengths_of(ways) ** 2).T / 2)  # of each of both directions
        across = np.linalg.svd(np.nan_to_num(arms)[:, None, :])[2][:, 1:]  # (N, 2, 3); a twin without rest has no arm
        normal = rng.standard_normal((count, len(ways), 2))
        return deviation[..., None] * np.einsum("dnk,nkx->dnx", normal, across)


@dataclass(frozen=True)
class Lacking:
    """What a model lacks, and what the trials that tell it went up to.

    model: SHA-256 of its file. tilt_deg: of the mount. pulled_tilt_deg: of the mount while a motor pulled. pull: of one
    motor, m. pulls: of all motors together, m. sure_pulls: likewise, up to which the certificate has the tip within
    `SURE` of the arm's length; 0 where none says so. load: at the tip, kg. residual_map: the part of it that recorded
    poses tell, None where there are too few. left: what is then lacking where these poses tell all.
    """

    model: str
    discrepancy: Discrepancy
    tilt_deg: float
    pulled_tilt_deg: float
    pull: float
    pulls: float
    sure_pulls: float = 0.0
    load: float = 0.0  # held-out trials with a load tell nothing of the model alone
    residual_map: ResidualMap | None = None
    left: Discrepancy | None = None

    def beyond(self, pulls: np.ndarray, tilt_deg: float) -> str:
        """What of a pose at rest without a load no trial went up to, "" where trials did: what each motor draws in, m
        (K,), and the mount."""
        pulled = bool((pulls > PULLED).any())
        tilt_bound = self.pulled_tilt_deg if pulled else self.tilt_deg
        if tilt_deg > tilt_bound + SAME_TILT:
            return f"mount tilted by {tilt_deg:.0f}°, trials {'with pulls ' if pulled else ''}up to {tilt_bound:.0f}°"
        if pulls.max(initial=0) > self.pull:
            return f"a motor pulls {1e3 * pulls.max():.1f} mm, in trials up to {1e3 * self.pull:.1f} mm"
        if pulls.sum() > self.pulls:
            return f"motors pull {1e3 * pulls.sum():.1f} mm together, in trials up to {1e3 * self.pulls:.1f} mm"
        return ""

    def table(self) -> dict:
        """As JSON has it."""
        names = ("tilt_deg", "pulled_tilt_deg", "pull", "pulls", "sure_pulls", "load")
        bounds = {name: getattr(self, name) for name in names}
        scales, learnt = _rounded(self.discrepancy), {}
        if self.residual_map is not None and self.left is not None:
            learnt = {"residual_map": self.residual_map.table() | {"scales_left": _rounded(self.left)}}
        return {"model": self.model, "trials": self.discrepancy.trials, "units": UNITS, "conditions": bounds,
                "scales": scales} | learnt  # fmt: skip

    @classmethod
    def from_table(cls, table: dict | None, model: str, source: str) -> "Lacking | None":
        """None where there is no table, where no trial tells what the model lacks, and of another `model`.

        Raises:
            InputError: naming `source`, which has something else.
        """
        if not table:
            return None
        try:
            if table["model"] != model:
                return None
            scales = np.array(table["scales"], dtype=float).reshape(-1, len(UNITS["scales"]))
            bounds = {name: float(bound) for name, bound in table["conditions"].items()}
            learnt, left = None, None
            if "residual_map" in table:
                learnt = ResidualMap.from_table(table["residual_map"])
                rest = np.array(table["residual_map"]["scales_left"], dtype=float).reshape(-1, len(UNITS["scales"]))
                left = Discrepancy(rest, len(learnt.poses))
            whole = Discrepancy(scales, int(table["trials"]))
            return cls(model, whole, **bounds, residual_map=learnt, left=left)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"{source}: {error!r}, expected what the stage report writes") from error


def read_lacking(file: Path, model: str) -> Lacking | None:
    """Of the model whose SHA-256 is `model`, from discrepancy.json; None where there is no such file."""
    return Lacking.from_table(read_discrepancy_table(file), model, str(file))


def read_discrepancy_table(file: Path) -> dict | None:
    """discrepancy.json as it is; None where there is none."""
    if not file.is_file():
        return None
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{file}: {error}, expected what the stage report writes") from error


def _rounded(discrepancy: Discrepancy) -> list[list[float]]:
    return [[float(f"{scale:.{DIGITS}g}") for scale in triple] for triple in discrepancy.scales.tolist()]


def lengths_of(ways: np.ndarray) -> np.ndarray:
    """What each scale multiplies: 1, g and p. From (N, 2) to (N, 3)."""
    return np.column_stack([np.ones(len(ways)), ways])
