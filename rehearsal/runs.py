"""Which runs a rehearsal is made of, and how they are made: side by side, each a row of the table when it ends."""

import multiprocessing
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

from threadpoolctl import threadpool_limits

from rehearsal.experiments.ablations import VARIANTS, varied
from rehearsal.experiments.bench import SharedRun, bench_of, perform
from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.experiments.result import Result, append_result, read_results
from trunkline.compute.cluster import VARIABLE
from trunkline.compute.processes import end_with_parent
from trunkline.compute.scheduler import arriving, elsewhere
from trunkline.errors import InputError
from trunkline.twin.package import package_digest
from trunkline.twin.package import read_package as read_files
from upkeep.provenance import REHEARSAL, SHOWN, stage_code


@dataclass(frozen=True)
class RunSource:
    """What runs are made of: `package` and `code`, digests; rows of another source do not count.

    code: of the files and settings that rehearsal/dvc.yaml lists for the stage, as DVC sees them, without the package.
    """

    package: str
    code: str

    def of(self, results: Iterable[Result]) -> list[Result]:
        return [result for result in results if (result.package, result.code) == (self.package, self.code)]


@dataclass(frozen=True)
class Run:
    experiment: str
    seed: int
    variant: str = ""


def source_of(package: Path) -> RunSource:
    """Of a package and of the checkout in whose top we are."""
    return RunSource(package_digest(read_files(package))[:SHOWN], stage_code(Path("."), *REHEARSAL))


def wanted(runs: dict[str, int], of_variants: int) -> list[Run]:
    """Seeds 0, 1, ... of each experiment, so many each, then of each of its variants; seed by seed, so that a stopped
    rehearsal has about as many of each."""
    plain = [Run(name, seed) for name, count in runs.items() for seed in range(count)]
    kinds = [(name, variant) for name in runs for variant in VARIANTS.get(name, {})]
    variants = [Run(name, seed, variant) for seed in range(of_variants) for name, variant in kinds]
    return sorted(plain, key=lambda run: run.seed) + variants


def make(
    runs: list[Run], package: Path, source: RunSource, table: Path, workers: int, others: Sequence[Path] = ()
) -> list[Result]:
    """Those of `runs` that `table` has not, of this source: copied from the tables `others` or made; then all of
    `runs` that it has."""
    chosen, made = set(runs), {run_of(result) for result in source.of(read_results(table))}
    for result in chain.from_iterable(source.of(read_results(other)) for other in others):
        if run_of(result) in chosen - made:
            append_result(table, result)
            made.add(run_of(result))
    missing = [run for run in runs if run not in made]
    for number, (result, seconds) in enumerate(performed(missing, package, workers), start=1):
        append_result(table, replace(result, package=source.package, code=source.code))
        outcome = "success" if result.success else result.cause
        name = f"{result.experiment}, {result.variant}" if result.variant else result.experiment
        print(f"{number} of {len(missing)}: {name} {result.seed}: {outcome}; {seconds:.0f} s of processor", flush=True)
    return [result for result in source.of(read_results(table)) if run_of(result) in chosen]


def make_one(bench: SharedRun, run: Run) -> tuple[Result, float]:
    """A run and its seconds of processor. One that breaks off by an error failed, and its cause is the error."""
    began = time.process_time()
    try:
        changed = varied(bench, run.experiment, run.variant) if run.variant else bench
        result, _ = perform(EXPERIMENTS[run.experiment](changed, run.seed))
    except Exception as error:  # hours of other runs shall not end with it
        result = Result(run.experiment, run.seed, False, f"error: {type(error).__name__}: {error}")
    return replace(result, variant=run.variant), time.process_time() - began


def performed(runs: list[Run], package: Path, workers: int) -> Iterator[tuple[Result, float]]:
    """Each run as it ends, and its seconds of processor; of no package or code yet."""
    if not runs:
        return
    if elsewhere():
        sent = _Sent(package.read_bytes(), source_of(package))
        yield from (result for _, result in arriving(_make_sent, runs, sent))
        return
    if workers == 1 or len(runs) == 1:
        bench = bench_of(package)
        yield from (make_one(bench, run) for run in runs)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, _begin, (package,)) as pool:
        try:
            for done in as_completed([pool.submit(_next, run) for run in runs]):
                yield done.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


@dataclass
class _Sent:
    """What a worker of a scheduler makes runs with: the package's bytes, and where `source` is from."""

    packed: bytes
    source: RunSource

    @cached_property
    def bench(self) -> SharedRun:
        with TemporaryDirectory() as folder:
            package = Path(folder) / "package.tgz"
            package.write_bytes(self.packed)
            if (local := source_of(package)) != self.source:
                raise InputError(
                    f"{VARIABLE}: a worker: found code and settings {local.code}, expected {self.source.code} as here"
                )
            return bench_of(package)


def _make_sent(sent: _Sent, run: Run) -> tuple[Result, float]:
    bench = sent.bench
    with threadpool_limits(1):
        return make_one(bench, run)


_bench: SharedRun | None = None  # of a worker


def _begin(package: Path) -> None:
    global _bench
    end_with_parent()
    threadpool_limits(1)
    _bench = bench_of(package)


def _next(run: Run) -> tuple[Result, float]:
    assert _bench is not None
    return make_one(_bench, run)


def run_of(result: Result) -> Run:
    return Run(result.experiment, result.seed, result.variant)
