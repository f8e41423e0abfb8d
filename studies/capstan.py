"""What friction of tendons on their holes (capstan friction) costs a model at rest: a Markdown table.

    python -m studies.capstan

Needs filtered trials with slow pulls (`static_pull`); of those whose name ends in `_back` the motors came from beyond.
The CAD model's stiffness, hardening, place of joints, motor gain, mount tilt and rest shape are fitted to tilts and
pulls at rest of the split identify, with and without friction; `test` is never read. The law of friction is that of
`trunkline/model/statics/capstan.py`. Pulls and backs may slide the same way, opposite ways (the law, if nothing but
motors moves the tendons), or have a μ each, positive where tension falls to the tip.
"""

import argparse
import sys
from pathlib import Path

import mujoco
import numpy as np
from scipy.optimize import least_squares

from stages.build_mjcf import Config as CadConfig
from stages.build_mjcf import cad_arm
from trunkline.errors import InputError, in_one_line
from trunkline.frames import rotation_from_wxyz
from trunkline.identification.parameters.parameters import PARAMETERS, candidate_fields, set_fields
from trunkline.identification.simulate.experiment import check_names, commanded_lengths, measured_pose
from trunkline.identification.simulate.pose_fit import fit_pose
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated
from trunkline.pipeline.config import load_config
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY, VALIDATE
from trunkline.recordings.trials.trial import Trial, read_trials
from upkeep.results import recorded

TRIALS = Path("data/processed/filter")
KINDS = ("static_tilt", "static_pull")
STEP = 1e-3  # of differences, on the axis of `Parameter.coordinate`
BOUNDS = {"stiffness": (0.3, 12.0), "hardening": (0.02, 20.0), "joint_place": (-0.2, 1.0), "kp": (100.0, 20000.0)}
BOUNDS |= dict.fromkeys(("mount_tilt_x", "mount_tilt_y"), (-0.1, 0.1))
BOUNDS |= dict.fromkeys(("rest_bend_x", "rest_bend_y", "rest_gradient_x", "rest_gradient_y"), (-0.05, 0.05))
FRICTION = (-0.5, 0.5)
START = {"hardening": 1.0}  # of what the CAD model lacks and cannot start from 0
# μ of pulls and of backs as numbers that are fitted give it, a column each; shape (2, m)
FORMS = {
    "without friction": np.zeros((2, 0)),
    "the same way always": np.array([[1.0], [1.0]]),
    "back against the way in": np.array([[1.0], [-1.0]]),
    "a μ each": np.eye(2),
}


class Fitted:
    """A form of friction, fitted to the trials to identify from.

    Attributes:
        friction: μ of pulls and of backs. Shape (2,). half_width: of what is fitted of it, 95 %, trials taken as
            independent of each other but not their segments. Shape (m,).
        values: of the fitted parameters. converged: whether the search ended by itself.
        cad: errors of the CAD model, as below.
        errors: distance of every segment, mm, of trials that do not come to rest NaN. Shape (B, S).
    """

    def __init__(self, model: mujoco.MjModel, trials: list[Trial], form: np.ndarray, start: np.ndarray | None) -> None:
        self._model, self._form = model, form
        self._trials = trials
        self._back = np.array([trial.name.endswith("_back") for trial in trials], dtype=int)
        self._commands = np.array([commanded_lengths(trial, model)[0] for trial in trials])
        self._seen = np.array([trial.positions[0] for trial in trials])
        fitted = np.array([trial.split == IDENTIFY for trial in trials])
        low, high = (
            np.array([*(PARAMETERS[name].coordinate(span[end]) for name, span in BOUNDS.items()),
                      *np.full(form.shape[1], FRICTION[end])])
            for end in (0, 1)
        )  # fmt: skip
        if start is None:
            start = np.array([PARAMETERS[n].coordinate(PARAMETERS[n].read(model) or START.get(n, 0.0)) for n in BOUNDS])
        start = np.clip(np.append(start[: len(BOUNDS)], np.full(form.shape[1], 0.05)), low + STEP, high - STEP)
        self.cad = self._distances(np.zeros(0))

        def residuals(vector: np.ndarray) -> np.ndarray:
            return np.nan_to_num(1e3 * (self._positions(vector) - self._seen)[fitted].reshape(-1), nan=100.0)

        found = least_squares(
            residuals, start, bounds=(low, high), diff_step=STEP, x_scale=high - low, max_nfev=100, ftol=1e-5
        )
        self.converged = bool(found.success)
        self.vector, self.errors = found.x, self._distances(found.x)
        self.values = {n: float(f"{PARAMETERS[n].value(v):.4g}") for n, v in zip(BOUNDS, found.x, strict=False)}
        self.friction = form @ found.x[len(BOUNDS) :]
        blocks = found.jac.reshape(fitted.sum(), -1, len(found.x))
        scores = np.einsum("trp,tr->tp", blocks, found.fun.reshape(fitted.sum(), -1))
        inverse = np.linalg.pinv(found.jac.T @ found.jac)
        deviation = np.sqrt(np.diag(inverse @ scores.T @ scores @ inverse))
        self.half_width = 1.96 * deviation[len(BOUNDS) :]

    def _positions(self, vector: np.ndarray) -> np.ndarray:
        """Segments at rest, m, NaN where an arm does not come to rest; of the CAD model for an empty vector.
        Shape (B, S, 3)."""
        model = self._model.__copy__()
        if vector.size:
            values = {n: np.array([PARAMETERS[n].value(v)]) for n, v in zip(BOUNDS, vector, strict=False)}
            set_fields(model, candidate_fields(model, values))
        chain = read_chain(model)
        turn = rotation_from_wxyz(model.body("base").quat)
        gravity = turn.inv().apply([trial.gravity for trial in self._trials])
        friction = self._form @ vector[len(BOUNDS) :] if vector.size else np.zeros(2)
        data, sites = mujoco.MjData(model), [model.site(f"{s}_center").id for s in self._trials[0].segments]
        positions = np.full(self._seen.shape, np.nan)
        for side, coefficient in enumerate(friction):
            rows = np.flatnonzero(self._back == side)
            found = actuated(chain._replace(capstan=float(coefficient)), self._commands[rows], gravity[rows])
            for row, qpos in zip(rows[found.converged], found.qpos[found.converged], strict=True):
                data.qpos[: len(qpos)] = qpos
                mujoco.mj_kinematics(model, data)
                positions[row] = data.site_xpos[sites]
        return positions

    def _distances(self, vector: np.ndarray) -> np.ndarray:
        return 1e3 * np.linalg.norm(self._positions(vector) - self._seen, axis=2)


def at_rest() -> list[Trial]:
    """The trials at rest without load, all with the same segments, to decide by.

    Raises:
        InputError: none of them is a slow pull.
    """
    trials = [trial for trial in read_trials(TRIALS, DECIDING) if trial.experiment in KINDS and not trial.load]
    if not any(trial.experiment == KINDS[1] for trial in trials):
        raise InputError(f"{TRIALS}: found no trial {KINDS[1]}, expected some")
    return trials


def row(title: str, friction: str, errors: np.ndarray, trials: list[Trial]) -> str:
    """Of the pulls position and tip error to identify from and on validate, then those on validate, pulls and backs."""
    pulls = np.array([trial.experiment == KINDS[1] for trial in trials])
    back = np.array([trial.name.endswith("_back") for trial in trials])
    unseen = np.array([trial.split == VALIDATE for trial in trials])
    cells = []
    for chosen in (pulls & ~unseen, pulls & unseen, pulls & ~back, pulls & back, ~pulls):
        cells.append(f"{np.mean(errors[chosen]):.2f} / {np.mean(errors[chosen, -1]):.2f}")
    return f"| {title} | {friction} | {' | '.join(cells)} |"


@in_one_line
@recorded("capstan")
def main() -> int:
    argparse.ArgumentParser(prog="studies.capstan", description=__doc__).parse_args()
    trials = at_rest()
    model = cad_arm(load_config(CadConfig, "build_mjcf")).spec.compile()
    for trial in trials:
        check_names(trial, model)
    print("Error of all segments / of the tip (mm), of tilts and pulls at rest.\n")
    print("| model | μ of pulls, of backs | pulls, identify | pulls, validate | straight there | back | tilts |")
    print("|---|---|---:|---:|---:|---:|---:|", flush=True)
    seen = np.array([trial.positions[0] for trial in trials])
    kinds = np.array([trial.experiment for trial in trials])
    told = np.array([trial.split == IDENTIFY for trial in trials])
    still = np.array([seen[told & (kinds == kind)].mean(axis=0) for kind in kinds])
    print(row("null: the mean shape", "", 1e3 * np.linalg.norm(still - seen, axis=2), trials), flush=True)
    start = None
    for title, form in FORMS.items():
        fitted = Fitted(model, trials, form, start)
        if start is None:
            print(row("CAD", "", fitted.cad, trials), flush=True)
            start = fitted.vector
        widths = ", ".join(f"± {width:.3f}" for width in fitted.half_width)
        print(f"{title}: {fitted.values}", file=sys.stderr)
        friction = f"{fitted.friction[0]:.3f}, {fitted.friction[1]:.3f} ({widths})" if form.size else ""
        shown = title if fitted.converged else f"{title} (search not ended)"
        print(row(shown, friction, fitted.errors, trials), flush=True)
    floor = [fit_pose(model, trial.segments, *measured_pose(trial, 0)).residuals for trial in trials]
    print(row("noise floor: joint angles fitted to each shape", "", 1e3 * np.array(floor), trials))
    return 0


if __name__ == "__main__":
    sys.exit(main())
