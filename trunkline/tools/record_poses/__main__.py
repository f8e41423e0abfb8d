"""Poses at rest to record, from which a residual map is learnt: `trunkline record-poses FOLDER`

Draws poses as the arm is driven later: one or two neighbouring motors of every section pull, by random amounts, and the
others are loose. Writes them into FOLDER, as poses.csv (how the mount is tilted, what each motor is sent, where the
twin's tip then rests) and session.yaml (a trial a pose); prints how to record them. Poses in which a motor would be
near its limit, or the twin does not rest, are not among them. params.yaml says under fk_dataset whether gravity counts.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from trunkline.errors import InputError, in_one_line
from trunkline.frames import downwards
from trunkline.identification.stages import final_model
from trunkline.kinematics.dataset.gravities import Tilts, Weightless
from trunkline.kinematics.residual.residual_map import FEWEST
from trunkline.model.arm_model import ArmModel
from trunkline.pipeline.config import load_folder, own_or_project, settings_of
from trunkline.pipeline.stage import output_folder
from trunkline.program import add_settings, command_parser
from trunkline.settings import read_yaml
from trunkline.tools.record_poses.draw import Mounts, PoseSampler, PosesToRecord
from trunkline.tools.record_poses.order import ordered
from trunkline.tools.record_poses.words import Schedule, how_lines, session_lines, table
from trunkline.tools.suggest.settings import Recordable
from trunkline.twin.twin import Twin

MOST = 500  # poses
ANY_SIDE = downwards(np.radians([0, 60, 60, 60, 60, 120, 120, 120]), np.radians([0, 0, 90, 180, 270, 0, 120, 240]))


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("record-poses", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="to be written; new, or empty")
    parser.add_argument("--model", type=Path, metavar="MODEL", help="MJCF of the twin; default: the pipeline's latest")
    parser.add_argument("--count", type=int, default=40, metavar="N", help="poses; default: 40")
    parser.add_argument("--pull", type=float, metavar="MM",
                        help="that a motor draws in at most; default: 0.8 of what its force can")  # fmt: skip
    parser.add_argument("--tilt", type=float, default=0.0, metavar="DEG",
                        help="of the mount at most; default: 0, it is not tilted")  # fmt: skip
    parser.add_argument("--sides", type=float, nargs="+", default=[], metavar="DEG",
                        help="to which it can be tilted, azimuths in the base frame; default: to any")  # fmt: skip
    parser.add_argument("--mounts", type=int, default=5, metavar="N", help="tilts of the mount; default: 5")
    parser.add_argument("--standing", action="store_true", help="the arm stands on its mount, and does not hang")
    parser.add_argument("--seed", type=int, default=1, help="of the draws; default: 1")
    add_settings(parser, "says where gravity pulls")
    args = parser.parse_args(arguments)
    _check(args)
    file = args.model or final_model(args.settings / "artifacts")
    if file is None:
        raise InputError(f"{args.settings}: found no identified model, expected one (run `dvc repro`) or --model")
    model = Twin.load(file).spec.compile()
    ArmModel(model).require_lengths("record-poses")
    if not model.nu:
        raise InputError(f"{file}: found no motor, expected an arm that pulls cables")
    mounts, downs, stroke = _gravities(args)
    source = PoseSampler(model, downs, stroke)
    most = 1e3 * float(source.deepest.max())
    if args.pull is not None and not args.pull <= most:
        raise InputError(f"--pull: found {args.pull:g}, expected at most {most:.0f} mm, as far as motors can")
    pull = None if args.pull is None else 1e-3 * args.pull
    poses = source.draw(args.count, mounts, pull, np.random.default_rng(args.seed))
    poses = poses[ordered(poses, mounts)]
    schedule = Schedule.of(ArmModel(model))
    with output_folder(args.folder.resolve()) as folder:
        (folder / "poses.csv").write_text(table(poses, source.names), encoding="utf-8")
        lines = session_lines(len(poses), source.names, mounts, schedule)
        (folder / "session.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    minutes = load_folder(Recordable, own_or_project(args.settings, "conf") / "suggest").minutes.static_tilt
    print("\n".join(_report(args, file, poses, how_lines(poses, mounts, schedule, minutes))))
    return 0


def _check(args: argparse.Namespace) -> None:
    """Refuse options that mean nothing, before any work."""
    if args.folder.exists() and (not args.folder.is_dir() or any(args.folder.iterdir())):
        raise InputError(f"{args.folder}: found something there, expected a new or an empty folder")
    if args.folder.resolve() == Path.cwd():
        raise InputError(f"{args.folder}: found the current folder, expected another one")
    if not FEWEST <= args.count <= MOST:
        raise InputError(f"--count: found {args.count}, expected {FEWEST} to {MOST} poses: fewer tell no residual map")
    if args.pull is not None and not args.pull > 0:
        raise InputError(f"--pull: found {args.pull:g}, expected more than 0 mm")
    if not 0 <= args.tilt <= 180:
        raise InputError(f"--tilt: found {args.tilt:g}, expected 0 to 180°")
    bad = [side for side in args.sides if not -360 <= side <= 360]
    if bad:
        raise InputError(f"--sides: found {bad[0]:g}, expected -360 to 360°")
    if not 1 <= args.mounts <= MOST:
        raise InputError(f"--mounts: found {args.mounts}, expected 1 to {MOST}")
    if args.seed < 0:
        raise InputError(f"--seed: found {args.seed}, expected 0 or more")


def _gravities(args: argparse.Namespace) -> tuple[Mounts, np.ndarray, float | None]:
    """How the arm is held; the directions of gravity and the stroke, m, of the network's data set, by `fk_dataset` of
    params.yaml, if it has that: else gravity from any side."""
    params = args.settings / "params.yaml"
    sampling = None
    if params.is_file() and "fk_dataset" in read_yaml(params):
        sampling = settings_of("fk_dataset", args.settings)
    weightless = sampling is not None and isinstance(sampling.gravity, Weightless)
    if weightless and (args.tilt or args.standing):
        option = "--tilt" if args.tilt else "--standing"
        raise InputError(f"{option}: found it, expected none: {params} says that gravity does not bend this arm")
    about_y = sampling is not None and isinstance(sampling.gravity, Tilts)  # the network knows no other tilts
    sides = tuple(args.sides) or ((0.0,) if about_y else ())
    mounts = Mounts(args.mounts, args.tilt, sides, args.standing, weightless)
    if sampling is None:
        return mounts, ANY_SIDE * [1, 1, -1 if args.standing else 1], None
    return mounts, sampling.gravity.downs, sampling.stroke


def _report(args: argparse.Namespace, file: Path, poses: PosesToRecord, how: list[str]) -> list[str]:
    dropped = f"{poses.near_limit} with a motor near its limit, {poses.unrested} in which the twin does not rest"
    return [
        f"twin: {file}",
        f"{len(poses)} poses at rest, pulls up to {1e3 * poses.pulls.max():.0f} mm; dropped: {dropped}",
        f"written to {args.folder}: poses.csv, what to send, and session.yaml, a trial a pose", "",
        *how, "",
        "then, the arm mounted as in its session: put the logs beside that session's, add the lines below `trials` of",
        f"{args.folder}/session.yaml to its session.yaml, and run",
        "  trunkline check data/raw/<session>", "  dvc repro",
        f"artifacts/report/certificate.html then shows what they brought; at least {FEWEST} have to be usable",
    ]  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
