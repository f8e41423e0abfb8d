"""What a process computes with: libraries, code, the processor's loops. Two that are alike give the same bits."""

import functools
import hashlib
import platform
import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path

OURS = "trunkline"
SHOWN = 12  # digits of a digest


@dataclass(frozen=True)
class Fingerprint:
    """parts: of each thing that matters what it is here, by its name. code_of: the package, beside the library, whose
    code matters."""

    parts: dict[str, str]
    code_of: str


def fingerprint_for(work: Callable) -> Fingerprint:
    """Of this process, in all that the function goes through."""
    return fingerprint(work.__module__.partition(".")[0])


@functools.lru_cache
def fingerprint(code_of: str) -> Fingerprint:
    """Of this process, with the code of one package beside the library's."""
    parts = {"Python": platform.python_version()}
    parts |= {name: _installed(name) for name in _libraries()}
    parts |= {f"code of {name}": _digest(name) for name in dict.fromkeys((OURS, code_of))}
    return Fingerprint(parts | {"loops for": _loops()}, code_of)


def difference_from(actual: Fingerprint | BaseException, expected: Fingerprint) -> str:
    """The first thing in which another process differs from this one, found and expected; empty if in none."""
    if not isinstance(actual, Fingerprint):
        return f"found no {OURS} like this one ({type(actual).__name__}: {actual}), expected the same code"
    for name, value in expected.parts.items():
        if (other := actual.parts.get(name, "none")) != value:
            return f"found {name} {other}, expected {value} as here"
    return ""


def _libraries() -> list[str]:
    """What the library asks for, and what plans: pyproject.toml's dependencies and its extra `teleop`."""
    asked = [line for line in requires(OURS) or [] if "extra ==" not in line or '"teleop"' in line.replace("'", '"')]
    return [OURS, *sorted(re.match(r"[\w.-]+", line).group() for line in asked)]  # type: ignore[union-attr]


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"


def _digest(package: str) -> str:
    """Of all the package's code."""
    spec, total = find_spec(package), hashlib.sha256()
    if spec is None or not spec.submodule_search_locations:
        return "none"
    root = Path(next(iter(spec.submodule_search_locations)))
    for file in sorted(root.rglob("*.py")):
        total.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return total.hexdigest()[:SHOWN]


def _loops() -> str:
    """The processor's instructions by which NumPy chose among its loops: those of `trunkline.compute.numerics`, or
    more."""
    from numpy._core._multiarray_umath import __cpu_features__ as features

    chosen = [name for name in ("X86_V4", "AVX512_ICL", "AVX512_SPR", "X86_V3", "AVX2", "ASIMD") if features.get(name)]
    return f"{platform.machine()} {' '.join(chosen)}".strip()
