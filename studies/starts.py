"""Whether a search finds the minimum wherever it begins: `python -m studies.starts`

Twenty times, the values of the model that a stage begins with are off by up to 3 times either way, each parameter by
its own factor, and the trials have other noise. The plant is a small arm that is not the model: heavier, with dry
friction in its joints (`studies.coverage`). The parameters are those of params.yaml, but for `capstan_friction`, as the
plant's cables do not rub. Ranges are a tenth to ten times the truth; those of parameters that may be 0 or less are the
committed ones, and the model begins with 0. The rough search is each stage's own, as committed, then least squares. The
best known loss of a session is the least of these, and of least squares from the truth and from more starts.
`converged` is what the stage would say. Takes some minutes.
"""

import argparse
import contextlib
import sys

import numpy as np
from threadpoolctl import threadpool_limits

from studies.coverage import FRAMES, STAGES, STEPS, UNITS, bounds_of, mismatched, settings_of
from tests.support.matched_plant import FRAME, segments_of, small_model
from tests.support.noisy_trials import WEIGHTS, measured, with_values
from trunkline.compute.progress import progress
from trunkline.errors import in_one_line
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import Problem
from trunkline.identification.fit.search import descend, search
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.simulate.experiment import prepare
from upkeep.results import recorded

SESSIONS = 20
OFF = 3.0  # times, at most, either way
POLISH = 12, 1e-6  # iterations and tolerance
KNOWN = LeastSquares(starts=15, descents=4, iterations=12, tolerance=1e-6)  # of the best known loss
WITHIN = 1.05  # times the best known loss


def quiet(best: float) -> None:
    """No progress of a single search."""


def session(name: str, seed: int) -> tuple[float, bool, int, int]:
    """One session of a stage: loss over the best known, whether it says converged, and how many starts agree of how
    many."""
    stage, settings = STAGES[name], settings_of(name)
    model = small_model(UNITS, stage.joints, **stage.motors)
    model.opt.timestep = FRAME / STEPS
    rng = np.random.default_rng([seed, list(STAGES).index(name)])
    scaled = {key: value for key, value in stage.true.items() if not PARAMETERS[key].signed}
    factors = OFF ** rng.uniform(-1, 1, len(scaled))
    begin = with_values(model, {key: f * value for (key, value), f in zip(scaled.items(), factors, strict=True)})
    trials = [measured(t, rng) for t in stage.trials(mismatched(with_values(model, stage.true)), FRAMES[name])]
    experiments = [prepare(trial, begin, FRAMES[name]) for trial in trials]
    problem = Problem(begin, experiments, segments_of(begin), bounds_of(name), "positions", WEIGHTS)
    rough = search(problem, settings.optimizer, seed, quiet)
    found = descend(problem, rough.vector, *POLISH, quiet)
    truth = np.array([PARAMETERS[key].coordinate(value) for key, value in stage.true.items()])
    known = [descend(problem, truth, *POLISH, quiet).loss, search(problem, KNOWN, seed + 1000, quiet).loss, found.loss]
    return found.loss / min(known), rough.converged and found.converged, rough.agreeing, rough.starts


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.starts", description=__doc__)
    parser.add_argument("--sessions", type=int, default=SESSIONS)
    arguments = parser.parse_args()
    with recorded("starts", keep=arguments.sessions == SESSIONS), threadpool_limits(1):
        print("| stage | within 5 % of the best known loss | worst | says converged | all starts agree | misled |")
        print("|---|---:|---:|---:|---:|---:|", flush=True)
        for name in STAGES:
            rows = []
            counting = progress(arguments.sessions, f"starts of {name}", "sessions")
            with contextlib.redirect_stdout(sys.stderr), counting as bar:
                for seed in range(arguments.sessions):
                    rows.append(session(name, seed))
                    bar.update(1)
            ratios = np.array([row[0] for row in rows])
            misled = sum(ratio > WITHIN and converged for ratio, converged, *_ in rows)
            cells = [f"{np.sum(ratios <= WITHIN)} of {len(rows)}", f"{ratios.max():.3f}"]
            cells += [str(sum(row[1] for row in rows)), str(sum(row[2] == row[3] for row in rows)), str(misled)]
            print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
        print("misled: it says converged, and is not within 5 %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
