"""Domain randomization for learning, from the identified parameters: `trunkline randomize [ARTIFACTS ...]`

ARTIFACTS is a folder with identify_*/parameters.json and arm.xml, by default `artifacts`. Writes a JSON with each
parameter's distribution, the covariances, and the fields of the MuJoCo model that each writes. Of several folders,
arms or sessions, it is what differs between them, about their mean; the model is the first one's. With --draws, a .npz
beside it has the fields of so many drawn models, for programs that know nothing of Trunkline.
"""

import argparse
import io
import json
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from trunkline.errors import InputError, in_one_line
from trunkline.files import file_digest, written_whole
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.stages import STAGES
from trunkline.program import program_name
from trunkline.report.certificate.identified import identified
from trunkline.tools.evaluate.model import read_arm
from trunkline.tools.randomize.fields import changed_fields, drawn_fields, of_model
from trunkline.tools.randomize.file import to_table
from trunkline.tools.randomize.randomization import Randomization, of_arm, of_population


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog=program_name("randomize"),
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("artifacts", type=Path, nargs="*", metavar="ARTIFACTS", default=[Path("artifacts")])
    parser.add_argument("--out", type=Path, metavar="JSON", default=Path("randomisation.json"))
    parser.add_argument("--widen", type=float, metavar="FACTOR", default=1.0,
                        help="times all standard deviations, for more than what is known to be open")  # fmt: skip
    parser.add_argument("--draws", type=int, metavar="N", default=0, help="drawn models, into a .npz beside --out")
    parser.add_argument("--seed", type=int, default=0, help="of the draws")
    args = parser.parse_args(arguments)
    if args.widen < 0 or args.draws < 0:
        raise InputError("--widen, --draws: found a number below 0, expected 0 or more")
    arms = [_arm_in(folder) for folder in args.artifacts]
    path, model = _model_in(args.artifacts[0])
    arms[0] = of_model(model, arms[0], str(path))
    drawn = (of_population(arms) if len(arms) > 1 else arms[0]).widened(args.widen)
    which = {"file": path.name, "sha256": file_digest(path), "mujoco": mujoco.__version__}
    table = to_table(drawn, changed_fields(model, drawn), which)
    if args.draws:
        x = drawn.draw(args.draws, np.random.default_rng(args.seed))
        packed = io.BytesIO()
        fields: dict[str, Any] = drawn_fields(model, drawn.values(x))
        np.savez_compressed(packed, **fields)
        _write(args.out.with_suffix(".npz"), packed.getvalue())
    _write(args.out, (json.dumps(table, indent=1) + "\n").encode())
    print("\n".join(_lines(table)))
    print(f"randomize: written to {args.out}" + (f" and {args.out.with_suffix('.npz')}" if args.draws else ""))
    return 0


def _stages_in(folder: Path) -> list[str]:
    """Those that have run, in their order.

    Raises:
        InputError: none has.
    """
    stages = [stage for stage in STAGES if (folder / stage / "parameters.json").is_file()]
    if not stages:
        raise InputError(f"{folder}: found no {STAGES[0]}/parameters.json, expected the artifacts of identification")
    return stages


def _arm_in(folder: Path) -> Randomization:
    tables = {}
    for stage in _stages_in(folder):
        path = folder / stage / "parameters.json"
        try:
            tables[stage] = json.loads(path.read_text(encoding="utf-8"))
            identified({stage: tables[stage]})
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path}: {error!r}, expected what a stage of identification writes") from error
    return of_arm(identified(tables))


def _model_in(folder: Path) -> tuple[Path, mujoco.MjModel]:
    path = folder / _stages_in(folder)[-1] / "arm.xml"
    return path, read_arm(path)


def _lines(table: dict) -> list[str]:
    """For people: a parameter a line."""
    width = max(map(len, table["parameters"]))
    lines = []
    for name, row in table["parameters"].items():
        low, high = row["interval_95"]
        unit = f" {row['unit']}" if parameter_named(name).unit else ""
        lines.append(f"{name:{width}}  {row['centre']:.4g}{unit}, 95 of 100 from {low:.4g} to {high:.4g}")
    return lines


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as part:
        part.write_bytes(content)


if __name__ == "__main__":
    sys.exit(main())
