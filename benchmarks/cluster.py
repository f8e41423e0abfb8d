"""`python -m benchmarks.cluster [--repeats 5] [--processes 1 2 4]`: identification on the workers of a scheduler.

One evaluation, candidates times trials of a small arm, on clusters of so many processes of this machine. All of them
are started first and take turns, so that who else uses the machine slows all alike; of each, the median counts. Time is
fitted with

    T(n) = a + b / min(n, cores) + c n

a: what is done once, here; b: what is spread; c: what each process more costs, 0 or more. What the law says of machines
that are not here is worked out below, each line with what it takes for granted.
"""

import argparse
import os
import statistics
import sys
import time

import numpy as np
from distributed import LocalCluster
from scipy.optimize import nnls

from tests.support.matched_plant import curl, motion, release, segments_of, small_model
from trunkline.errors import in_one_line
from trunkline.identification.experiment import prepare
from trunkline.identification.parameters import candidate_fields
from trunkline.identification.population import Population
from trunkline.pipeline.results import recorded
from trunkline.scheduler import PIECES, VARIABLE, spread
from trunkline.threads import thread_count

CANDIDATES, TRIALS, EMPTY = 16, 7, 200
ARMS = 1000


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.cluster", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2, 4])
    given = parser.parse_args()
    with recorded("cluster"):
        measure(given.processes, given.repeats)
    return 0


def measure(processes: list[int], repeats: int) -> None:
    model = small_model()
    trials = [release(model, bend, frames=120) for bend in (0.3, -0.25, 0.2)]
    trials += [curl(model, pull, frames=120) for pull in (30, 40, 50)] + [motion(model, 30, frames=120)]
    experiments = [prepare(trial, model, 437) for trial in trials]
    fields = candidate_fields(model, {"damping": np.geomspace(0.01, 0.05, CANDIDATES)})
    cores = min(thread_count(), len(os.sched_getaffinity(0)))
    print(f"{CANDIDATES} candidates on {len(trials)} trials; {cores} cores, load before {os.getloadavg()[0]:.1f}")

    whole = Population(model, experiments, segments_of(model))
    os.environ["TRUNKLINE_THREADS"] = "1"
    reference = whole.simulate(fields)
    size = sum(one.nbytes for one in reference.positions)
    clusters = {n: _cluster(n) for n in processes}
    times: dict[int, list[float]] = {n: [] for n in (0, *processes)}
    empty: list[float] = []
    populations = {n: Population(model, experiments, segments_of(model)) for n in times}
    for turn in range(repeats + 1):  # the first one makes what is kept
        for n, population in populations.items():
            if n:
                os.environ[VARIABLE] = clusters[n].scheduler_address
            begun = time.perf_counter()
            found = population.simulate(fields)
            if turn:
                times[n].append(time.perf_counter() - begun)
            begun = time.perf_counter()
            if n == processes[-1]:
                spread(_nothing, list(range(EMPTY)))
                empty += [(time.perf_counter() - begun) / EMPTY] if turn else []
            os.environ.pop(VARIABLE, None)
            assert all(np.array_equal(a, b) for a, b in zip(found.positions, reference.positions, strict=True))
    print("every result is the same bits as without a scheduler")
    tell(times, statistics.median(empty), size, cores, processes)
    for cluster in clusters.values():
        cluster.close()


def _cluster(processes: int) -> LocalCluster:
    options: dict = {"dashboard_address": None, "silence_logs": "CRITICAL"}
    return LocalCluster(n_workers=processes, threads_per_worker=1, processes=True, **options)


def _nothing(_, piece: int) -> int:
    return piece


def tell(times: dict[int, list[float]], piece: float, size: int, cores: int, processes: list[int]) -> None:
    """The table, the law, and where it leads. times: s, by processes, 0 for none. piece: s, an empty one."""
    middle = {n: statistics.median(values) for n, values in times.items()}
    print("| processes | an evaluation | spread of repeats | of the time without a scheduler, one thread |")
    print("|---:|---:|---:|---:|")
    for n, values in times.items():
        of = f"{middle[n] / middle[0]:.2f}"
        print(f"| {n or 'none'} | {middle[n]:.3f} s | {min(values):.3f} to {max(values):.3f} s | {of} |")
    rows = np.array([[1.0, 1 / min(n, cores), n] for n in processes])
    (a, b, c), left = nnls(rows, np.array([middle[n] for n in processes]))
    off = left / len(processes) ** 0.5
    print(f"T(n) = {a:.3f} s + {b:.3f} s / min(n, {cores}) + {c:.4f} s n; off by {off:.3f} s RMS")
    print(f"an empty piece takes {1e3 * piece:.1f} ms, an evaluation brings back {size / 1e6:.1f} MB")
    print("one arm's fit (Amdahl; a core for each worker, a network as fast as here, a, b and c as here):")
    for n in (2, 8, 32):
        print(f"    {n} workers: {(a + b + c) / (a + b / n + c * n):.1f} times as fast as one")
    print(f"{ARMS} arms, each with a client and a core of its own (Gustafson; they share only a scheduler, which does")
    print("one piece after the other, each as long as an empty one):")
    alone = a + b + c
    most = max(k for k in range(1, ARMS + 1) if k * pieces_of(k) * piece <= alone or k == 1)
    print(f"    a scheduler keeps up with {most} arms and as many workers, so {-(-ARMS // most)} schedulers;")
    print(f"    workers are at work {b / alone:.0%} of the time; {ARMS * size / alone / 1e6:.0f} MB/s go to clients")


def pieces_of(workers: int) -> int:
    """Into which an evaluation is cut where there are so many."""
    return min(PIECES * workers, CANDIDATES * TRIALS) if workers > 1 else 1


if __name__ == "__main__":
    sys.exit(main())
