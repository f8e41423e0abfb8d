"""(3) Loss and time against `mujoco.sysid.optimize` on the same residuals, and where that stalls."""

import contextlib
import io
from dataclasses import replace

import numpy as np

from benchmarks.identification.case import SAME_LOSS, STAGES, Case, Identified, ReadCase, Size, identified
from benchmarks.identification.rival import Rival
from trunkline.identification.fit.linearisation import DIFFERENCE, linearise
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.simulate.loss import loss_of

UNMOVED = 0.01  # a value that changed by less than this share of itself was left where it was


def report(read_case: ReadCase, size: Size) -> None:
    print("(3) against mujoco.sysid.optimize from the CAD values, same residuals, its columns batched too")
    for stage in STAGES:
        case = read_case(stage, size)
        descent = identified(from_the_same_start(case))
        own = identified(case)
        print(f"    {stage}, {len(case.experiments)} trials, from {case.values(case.problem().start())}")
        for name, found in {"identify": own, "descent alone": descent}.items():
            print(f"      {name:18s} {found.loss:.4g}; {case.unseen_errors(found.vector)}")
            print(f"                         ended, with intervals, after {found.spent}; {case.values(found.vector)}")
        for name, options in {"as it comes": {}, f"eps {DIFFERENCE:g}": {"eps": DIFFERENCE}}.items():
            rival = by_sysid(case, size.budget / 2, **options)
            total, first = rival.clock.read(), rival.reached(SAME_LOSS * rival.best)
            assert rival.vector is not None
            assert first is not None
            print(f"      sysid, {name:11s} {rival.best:.4g} in {first}; {case.unseen_errors(rival.vector)}")
            print(f"                         {case.values(rival.vector)}")
            print(f"                         ended after {total}")
            for title, found in {"identify": own, "descent alone": descent}.items():
                same = found.watch.reached(SAME_LOSS * rival.best)
                when = f"there after {same}, {same.wall / first.wall:.2f} of its time" if same else "never there"
                cpu = f" (CPU {same.cpu / first.cpu:.2f})" if same else ""
                print(f"                         {title}: {found.loss / rival.best:.3f} x its loss, {when}{cpu}")
            for line in stalled(case, rival.vector, own):
                print(f"                         {line}")


def from_the_same_start(case: Case) -> Case:
    """As `optimizer: least_squares` with `starts: 0`: no search over the ranges, as sysid has none."""
    optimizer = LeastSquares(starts=0, descents=1, iterations=6, tolerance=1e-2)
    return replace(case, fit=replace(case.fit, method=replace(case.fit.method, optimizer=optimizer)))


def by_sysid(case: Case, budget: float, **options) -> Rival:
    """`mujoco.sysid.optimize` from the values in the model, on the same residuals, columns as one batch."""
    from mujoco import sysid

    problem = case.problem()
    rows = zip(case.fit.parameters, problem.start(), *problem.bounds(), strict=True)
    parameters = sysid.ParameterDict({row[0]: sysid.Parameter(*row) for row in rows})
    rival = Rival(budget=budget)

    def residual(x: np.ndarray, _) -> tuple:
        vectors = np.ascontiguousarray(x.reshape(len(x), -1).T)
        residuals = np.concatenate(problem.residuals(vectors), axis=1)
        rival.note(vectors, loss_of(residuals))
        return [residuals.T if x.ndim == 2 else residuals[0]], None, None

    with contextlib.suppress(Rival.Stop), contextlib.redirect_stdout(io.StringIO()):
        sysid.optimize(parameters, residual, verbose=False, **options)
    return rival


def stalled(case: Case, vector: np.ndarray, own: Identified) -> list[str]:
    """Which parameters a search left at the model's values although `identify` moved them, one line each, and why.

    A parameter on which no residual depends at the start (a force range above every force) gives a descent nothing
    to go by.
    """
    start = case.problem().start()
    blind = ~np.any(np.concatenate(linearise(case.problem(), start).jacobians), axis=0)
    lines = []
    for i, name in enumerate(case.fit.parameters):
        if abs(vector[i] - start[i]) < UNMOVED <= abs(own.vector[i] - start[i]):
            why = "no residual depends on it there" if blind[i] else "residuals do depend on it there"
            vague = ", undetermined" if name in own.undetermined else ""
            lines.append(
                f"stalls: {name} left at {np.exp(start[i]):.4g} {PARAMETERS[name].unit}, {why}; "
                f"identify: {np.exp(own.vector[i]):.4g}{vague}"
            )
    return lines
