"""`python -m benchmarks.cluster [--turns 20] [--processes 1 2 3 4]`: identification on the workers of a scheduler.

One evaluation, candidates times trials of a small arm, on clusters of so many processes of this machine. All of them
are started first and take turns, so that who else uses the machine slows all alike; of each, the median counts. A turn
is a row of docs/results/cluster.csv as soon as it is done; stopped, the benchmark goes on from there. With other
processes than by default nothing is kept. Time is fitted with

    T(n) = a + b / min(n, cores) + c n

a: what is done once, here; b: what is spread; c: what each process more costs; none of them negative. What the law says
of machines that are not here is worked out below it, each line with what it takes for granted.
"""

import argparse
import os
import statistics
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from typing import Any

import numpy as np
from distributed import LocalCluster
from scipy.optimize import nnls

from studies.rows import Rows, digest
from tests.support.matched_plant import curl, motion, release, segments_of, small_model
from trunkline.compute.cluster import VARIABLE
from trunkline.compute.scheduler import PIECES, spread
from trunkline.compute.threads import thread_count
from trunkline.errors import in_one_line
from trunkline.identification.parameters.parameters import candidate_fields
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.population import Population
from upkeep.results import recorded

CANDIDATES, FRAMES, EMPTY = 16, 120, 200
BENDS, PULLS, REACH = (0.3, -0.25, 0.2), (30, 40, 50), 30  # rad, mm, mm
TRIALS = len(BENDS) + len(PULLS) + 1
TURNS, PROCESSES, ARMS = 20, [1, 2, 3, 4], 1000


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.cluster", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--turns", type=int, default=TURNS)
    parser.add_argument("--processes", type=int, nargs="+", default=PROCESSES)
    given = parser.parse_args()
    cores, kept = min(thread_count(), len(os.sched_getaffinity(0))), given.processes == PROCESSES
    made_of = digest((CANDIDATES, FRAMES, EMPTY, BENDS, PULLS, REACH, cores, PROCESSES))
    rows = Rows("cluster", made_of, "turn") if kept else None
    with recorded("cluster", kept and given.turns == TURNS, origin=rows and rows.origin):
        turns = list(rows.read().values()) if rows else []
        for turn in measured(given.processes, given.turns - len(turns)):
            if rows:
                rows.add(str(len(turns)), **turn)
            turns.append(turn)
        print(f"{CANDIDATES} candidates on {TRIALS} trials, {len(turns)} turns, {cores} cores")
        print("every evaluation gave the same bits as one without a scheduler")
        if rows and (told := rows.attempts()):
            print(told)
        tell(turns, given.processes, cores)
    return 0


def measured(processes: list[int], turns: int) -> Iterator[dict[str, float]]:
    """Of each turn, in s: an evaluation by how many processes of workers do it, 0 for this one alone; and an empty
    piece of work on the most of them. In bytes: what an evaluation brings back."""
    if turns < 1:
        return
    model = small_model()
    trials = [release(model, bend, frames=FRAMES) for bend in BENDS]
    trials += [curl(model, pull, frames=FRAMES) for pull in PULLS] + [motion(model, REACH, frames=FRAMES)]
    experiments = [prepare(trial, model, 437) for trial in trials]
    fields = candidate_fields(model, {"damping": np.geomspace(0.01, 0.05, CANDIDATES)})
    with ExitStack() as stack:
        stack.enter_context(environment("TRUNKLINE_THREADS", "1"))
        reference = Population(model, experiments, segments_of(model)).simulate(fields).positions
        clusters = {n: stack.enter_context(cluster_of(n)) for n in processes}
        populations = {n: Population(model, experiments, segments_of(model)) for n in (0, *processes)}
        for number in range(turns + 1):
            turn: dict[str, float] = {"bytes": sum(one.nbytes for one in reference)}
            for n, population in populations.items():
                with environment(VARIABLE, clusters[n].scheduler_address) if n else nullcontext():
                    begun = time.perf_counter()
                    found = population.simulate(fields).positions
                    turn[f"{n} s"] = time.perf_counter() - begun
                assert all(np.array_equal(one, other) for one, other in zip(found, reference, strict=True))
            with environment(VARIABLE, clusters[processes[-1]].scheduler_address):
                begun = time.perf_counter()
                spread(_nothing, list(range(EMPTY)))
                turn["empty s"] = (time.perf_counter() - begun) / EMPTY
            if number:  # the first one makes what is kept
                yield turn


def cluster_of(processes: int) -> Any:  # by its types a cluster is to be awaited
    options: dict = {"dashboard_address": None, "silence_logs": "CRITICAL"}
    return LocalCluster(n_workers=processes, threads_per_worker=1, processes=True, **options)


@contextmanager
def environment(name: str, value: str) -> Iterator[None]:
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        yield
    finally:
        os.environ.pop(name)
        if before is not None:
            os.environ[name] = before


def _nothing(_, piece: int) -> int:
    return piece


def tell(turns: list[dict], processes: list[int], cores: int) -> None:
    """The table, the law, and where it leads, of turns as `measured` gives them."""
    times = {n: [float(turn[f"{n} s"]) for turn in turns] for n in (0, *processes)}
    middle = {n: statistics.median(values) for n, values in times.items()}
    piece, size = statistics.median(float(turn["empty s"]) for turn in turns), int(turns[0]["bytes"])
    print("| processes of workers | an evaluation | quickest and slowest | of the time without a scheduler |")
    print("|---:|---:|---:|---:|")
    for n, values in times.items():
        of = f"{middle[n] / middle[0]:.2f}"
        name = n or "none, one thread"
        print(f"| {name} | {middle[n]:.3f} s | {min(values):.3f} to {max(values):.3f} s | {of} |")
    a, b, c, off = law(middle, processes, cores)
    fit = f"off by {1e3 * off:.0f} ms RMS at {len(processes)} medians"
    print(f"T(n) = {a:.3f} s + {b:.3f} s / min(n, {cores}) + {c:.4f} s n; {fit}")
    print(f"an empty piece takes {1e3 * piece:.1f} ms, an evaluation brings back {size / 1e6:.1f} MB")
    print("one arm's fit (Amdahl; a core for each worker, a network as fast as here, a, b and c as here):")
    for n in (2, 8, 32):
        print(f"    {n} workers: {(a + b + c) / (a + b / n + c * n):.1f} times as fast as one")
    alone = a + b + c
    most = max(k for k in range(1, ARMS + 1) if k == 1 or k * pieces_of(k) * piece <= alone)
    print(f"{ARMS} arms, each with a client and a core of its own (Gustafson; they share only a scheduler, which does")
    print("one piece after the other, each as long as an empty one):")
    print(f"    a scheduler keeps up with {most} arms and as many workers, so {-(-ARMS // most)} schedulers;")
    print(f"    workers are at work {b / alone:.0%} of the time; {ARMS * size / alone / 1e6:.0f} MB/s go to clients")


def law(times: dict[int, float], processes: list[int], cores: int) -> tuple[float, float, float, float]:
    """a, b and c of the law, and how far it is off, all in s."""
    terms = np.array([[1.0, 1 / min(n, cores), n] for n in processes])
    (a, b, c), left = nnls(terms, np.array([times[n] for n in processes]))
    return a, b, c, left / len(processes) ** 0.5


def pieces_of(workers: int) -> int:
    """Into which an evaluation is cut where there are so many."""
    return min(PIECES * workers, CANDIDATES * TRIALS) if workers > 1 else 1


if __name__ == "__main__":
    sys.exit(main())
