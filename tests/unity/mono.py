"""Mono's compiler of C#, for the tests of the package's scripts."""

import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import pytest

LANGUAGE = "7.2"  # of the core, and the newest that Mono's compiler knows; Unity 6 compiles 9


def compiled(out: Path, sources: Iterable[Path], references: Iterable[Path] = (), *options: str) -> Path:
    """A library or program `out` (by its ending) of these sources; what its libraries are linked to beside it.

    Fails the test in one line where there is no compiler, and with what the compiler says where it refuses.
    """
    for name in ("mcs", "mono"):
        if shutil.which(name) is None:
            pytest.fail(f"{name}: no such program; `make mono` installs Debian's Mono", pytrace=False)
    kind = "library" if out.suffix == ".dll" else "exe"
    command = ["mcs", f"-langversion:{LANGUAGE}", "-warnaserror+", "-nologo", f"-target:{kind}", f"-out:{out}"]
    command += [*options, *(f"-r:{path}" for path in references), *map(str, sources)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return out
