"""How long the Unity package's C# core takes under Mono, with a package's maps and shared vectors.

    python -m benchmarks.csharp [artifacts/package_unity/*.tgz]

Each query or step is asked in eight rounds, between the others, and its least time counts; what is told is over the
queries: mean, median, 95th percentile, max, and the share above the goal, 50 µs, which is one of the 95th percentile.
Where gravity turns each time, nothing that was summed before is of use. Needs `make mono`.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from trunkline.twin.package import read_tarball
from trunkline.unity.assemble import CSHARP
from upkeep.results import recorded

PROGRAM = Path("tests/unity/csharp")
SHARED = [CSHARP / "Tests" / name for name in ("Comparison.cs", "Messages.cs", "SharedVectors.cs")]


@recorded("csharp")
def main(package: Path) -> None:
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for path, data in read_tarball(package).items():
            (folder / "package" / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / "package" / path).write_bytes(data)
        sources = [*sorted((CSHARP / "Core").glob("*.cs")), *SHARED, *sorted(PROGRAM.glob("*.cs"))]
        program = folder / "core.exe"
        subprocess.run(["mcs", "-langversion:7.2", "-nologo", f"-out:{program}", *sources], check=True)
        command = ["mono", program, folder / "package", "--time"]
        told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    print(*(line for line in told.splitlines() if "µs" in line), sep="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else next(Path("artifacts/package_unity").glob("*.tgz")))
