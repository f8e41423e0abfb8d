"""What every stage does around its one library call: load, report, write whole or not at all."""

import json
import math
import os
import resource
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from threadpoolctl import threadpool_limits

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import load_config
from trunkline.pipeline.settings import check_once

Config = TypeVar("Config")


def run_stage(name: str, schema: type[Config], main: Callable[[Config], None], root: str | Path = ".") -> None:
    """Call `main` with the stage's settings; a user's mistake ends in one line and exit code 1.

    `root` holds the stage's `params.yaml` and `conf/`. Meanwhile BLAS keeps to one thread, as its sums, and
    so the results, otherwise depend on how many cores there are; `TRUNKLINE_THREADS` is for what does not.
    """
    started = time.monotonic()

    @in_one_line
    def run() -> int:
        if "DVC_STAGE" in os.environ:  # the pipeline runs: others may come after this one
            check_once(name)
        config = load_config(schema, name, root)
        with threadpool_limits(1, user_api="blas"):
            main(config)
        return 0

    if run():
        sys.exit(1)
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # Linux counts in KiB
    print(f"{name}: done in {time.monotonic() - started:.1f} s, peak memory {peak_mib:.0f} MiB")


@contextmanager
def output_folder(path: str | Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path`; it replaces `path` on success and vanishes on failure."""
    path = Path(path)
    partial, old = path.with_name(f".{path.name}.partial"), path.with_name(f".{path.name}.old")
    for leftover in (partial, old):
        shutil.rmtree(leftover, ignore_errors=True)
    partial.mkdir(parents=True)
    try:
        yield partial
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    if path.exists():
        os.rename(path, old)
    os.rename(partial, path)
    shutil.rmtree(old, ignore_errors=True)


def write_metrics(folder: Path, metrics: object) -> None:
    """Write `metrics.json`, its floats to 4 significant digits, so that noise of another machine changes no file.

    Raises:
        InputError: as `write_json`.
    """
    write_json(folder / "metrics.json", metrics, digits=4)


def write_json(path: str | Path, data: object, digits: int = 9) -> None:
    """Write JSON that is the same for the same results: sorted keys, floats to so many significant digits.

    NumPy scalars and arrays become numbers and lists.

    Raises:
        InputError: naming file and key, if a number is not finite.
    """
    text = json.dumps(_plain(data, f"{path}: ", digits), indent=2, sort_keys=True, allow_nan=False)
    Path(path).write_text(text + "\n", encoding="utf-8")


def _plain(value: object, key: str, digits: int) -> object:
    tolist = getattr(value, "tolist", None)  # of NumPy scalars and arrays
    if tolist is not None:
        value = tolist()
    if isinstance(value, dict):
        return {
            str(k): _plain(v, f"{key}{k}" if key.endswith(": ") else f"{key}.{k}", digits) for k, v in value.items()
        }
    if isinstance(value, list | tuple):
        return [_plain(v, f"{key}[{i}]", digits) for i, v in enumerate(value)]
    if isinstance(value, float):
        if not math.isfinite(value):
            raise InputError(f"{key}: found {value}, expected a finite number")
        return float(f"{value:.{digits}g}")
    return value
