"""The statics' own kernels side by side with numpy's in the same compiler: what each earns.

    python -m benchmarks.small_linear_algebra [arm.xml]

One thread, CPU time, the fastest of several rounds taken in turns. Compilation is not counted.
"""

import sys
import time
from pathlib import Path

import numba
import numpy as np

from trunkline.frames import gravity_in_base
from trunkline.model.statics.cables import solve_small
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.energy import Pull, evaluate, find_hessian
from trunkline.model.statics.factor import factorize, solve
from trunkline.model.statics.newton import new_work
from trunkline.model.statics.vectors import cross, product, vector
from trunkline.pipeline.inputs import read_model
from upkeep.results import recorded

CALLS, ROUNDS = 20_000, 7


@numba.njit
def own_newton_step(calls, hessian, factor, x):
    for _ in range(calls):
        factorize(hessian, factor)
        solve(hessian, factor, x)
        x /= np.abs(x).max()
    return x[0]


@numba.njit
def dense_newton_step(calls, matrix, x):
    for _ in range(calls):
        np.linalg.cholesky(matrix)  # says whether the equilibrium is stable
        x = np.linalg.solve(matrix, x)
        x /= np.abs(x).max()
    return x[0]


@numba.njit
def own_small(calls, matrix, right, scratch, x):
    for _ in range(calls):
        for i in range(3):
            x[i] = right[i]
            for j in range(3):
                scratch[i, j] = matrix[i, j]
        solve_small(scratch, x)
    return x[0]


@numba.njit
def library_small(calls, matrix, right):
    total = 0.0
    for _ in range(calls):
        total += np.linalg.solve(matrix, right)[0]
    return total


@numba.njit
def own_cross(calls, vectors):
    total = 0.0
    for k in range(calls):
        total += cross(vector(vectors, k % 8), vector(vectors, (k + 1) % 8))[0]
    return total


@numba.njit
def library_cross(calls, vectors):
    total = 0.0
    for k in range(calls):
        total += np.cross(vectors[k % 8], vectors[(k + 1) % 8])[0]
    return total


@numba.njit
def own_product(calls, matrices):
    total = 0.0
    for k in range(calls):
        a, b = matrices[k % 8], matrices[(k + 1) % 8]
        total += product((vector(a, 0), vector(a, 1), vector(a, 2)), (vector(b, 0), vector(b, 1), vector(b, 2)))[0][0]
    return total


@numba.njit
def library_product(calls, matrices):
    total = 0.0
    for k in range(calls):
        total += (matrices[k % 8] @ matrices[(k + 1) % 8])[0, 0]
    return total


@recorded("small_linear_algebra")
def main(path: Path) -> None:
    chain = read_chain(read_model(path))
    rng = np.random.default_rng(0)
    work, gravity = new_work(chain.units, chain.tendons), gravity_in_base(1.0)
    free = np.zeros(chain.tendons)
    pull = Pull(free, free, free, free, np.zeros((chain.units, 2)), 0.0, np.zeros((chain.units, chain.tendons)))
    evaluate(chain, rng.uniform(-0.1, 0.1, 2 * chain.units), gravity, pull, work.state)
    hessian = find_hessian(gravity, pull, work.state)
    matrix = np.triu(hessian.left.T @ hessian.right, 1)
    matrix[np.arange(0, len(matrix), 2), np.arange(1, len(matrix), 2)] = hessian.block[:, 1]
    matrix += matrix.T + np.diag(hessian.block[:, [0, 2]].ravel())
    x, small = np.ones(len(matrix)), rng.normal(size=(3, 3)) + 3 * np.eye(3)
    vectors, matrices = rng.normal(size=(8, 3)), rng.normal(size=(8, 3, 3))
    compare(
        f"factor.factorize, solve against np.linalg.cholesky, solve: {len(x)} unknowns",
        lambda: own_newton_step(CALLS // 20, hessian, work.factor, x.copy()),
        lambda: dense_newton_step(CALLS // 20, matrix, x.copy()),
    )
    compare(
        "cables.solve_small against np.linalg.solve: 3 unknowns",
        lambda: own_small(CALLS, small, np.ones(3), np.empty((3, 3)), np.empty(3)),
        lambda: library_small(CALLS, small, np.ones(3)),
    )
    compare("vectors.cross against np.cross", lambda: own_cross(CALLS, vectors), lambda: library_cross(CALLS, vectors))
    compare(
        "vectors.product against @: 3 x 3",
        lambda: own_product(CALLS, matrices),
        lambda: library_product(CALLS, matrices),
    )


def compare(name: str, own, library) -> None:
    """Print how many times faster `own` is."""
    seconds = {own: np.inf, library: np.inf}
    for work in (own, library) * (ROUNDS + 1):  # the first round compiles
        started = time.process_time()
        work()
        seconds[work] = min(seconds[work], time.process_time() - started)
    print(f"{name:75s} {seconds[library] / seconds[own]:6.1f} times as fast", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "artifacts/identify_control/arm.xml"))
