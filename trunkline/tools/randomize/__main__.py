"""Domain randomization for learning, from the identified parameters: `trunkline randomize [ARTIFACTS ...]`

ARTIFACTS is a folder with identify_*/parameters.json and arm.xml, by default `artifacts`. Writes a JSON with each
parameter's distribution, the covariances, and the fields of the MuJoCo model that each writes. Of several folders,
arms or sessions, it is what differs between them, about their mean; the model is the first one's. With --draws, a .npz
beside it has the fields of so many drawn models, for programs that know nothing of Trunkline.
"""

import io
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from trunkline.errors import InputError, in_one_line
from trunkline.files import written_whole
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.program import command_parser
from trunkline.tools.randomize.fields import changed_fields, check_model, drawn_fields
from trunkline.tools.randomize.file import to_table
from trunkline.tools.randomize.population import of_population
from trunkline.twin.twin import Twin


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("randomize", __doc__)
    parser.add_argument("artifacts", type=Path, nargs="*", metavar="ARTIFACTS", default=[Path("artifacts")])
    parser.add_argument("--out", type=Path, metavar="JSON", default=Path("randomisation.json"))
    parser.add_argument("--widen", type=float, metavar="FACTOR", default=1.0,
                        help="times all standard uncertainties, for more than what is known to be open")  # fmt: skip
    parser.add_argument("--draws", type=int, metavar="N", default=0, help="drawn models, into a .npz beside --out")
    parser.add_argument("--seed", type=int, default=0, help="of the draws")
    args = parser.parse_args(arguments)
    if args.widen < 0 or args.draws < 0:
        raise InputError("--widen, --draws: found a number below 0, expected 0 or more")
    twins = [Twin.load(folder) for folder in args.artifacts]
    model, provenance = twins[0].arm.model, twins[0].provenance
    check_model(twins[0])
    posterior = of_population([twin.posterior for twin in twins]) if len(twins) > 1 else twins[0].posterior
    posterior = replace(posterior, deviation=args.widen * posterior.deviation)
    which = {"file": provenance.model.name, "sha256": provenance.digest, "mujoco": mujoco.__version__}
    table = to_table(posterior, len(twins), changed_fields(model, posterior), which)
    if args.draws:
        packed = io.BytesIO()
        fields: dict[str, Any] = drawn_fields(model, posterior.sample(args.draws, args.seed))
        np.savez_compressed(packed, **fields)
        _write(args.out.with_suffix(".npz"), packed.getvalue())
    _write(args.out, (json.dumps(table, indent=1) + "\n").encode())
    print("\n".join(_lines(table)))
    print(f"randomize: written to {args.out}" + (f" and {args.out.with_suffix('.npz')}" if args.draws else ""))
    return 0


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
