"""Why is the robot's tip beside the previewed one? The distance taken apart, in a few runs of `grasp`.

    python -m studies.grasp_shares [--runs 6] [--package artifacts/package_unity/...tgz]

At time t of a plan, from where the arm begins to curl, with m the mount,

    seen(t) - nominal(t) =   seen(t) - tip(t)                             alignment of the base
                           + m(t) - m_nominal(t)                          mount: servos that lag
                           + rest                                         arm at rest: its bend beside the twin's
                           + (tip - m)(t) - (tip - m)_nominal(t) - rest   curling: pull, contacts, load

`rest` is the last but one as the curl begins. Each is the median of its length in a run, % of the arm's length; the
last two columns are the curling's in the phases curl and lift. One future is previewed, with all as it is believed.
"""

import argparse
from pathlib import Path

import numpy as np

from rehearsal.experiments.ablations import varied
from rehearsal.experiments.bench import Bench, SessionFrame, bench_of, rehearse
from rehearsal.experiments.grasp import grasp
from rehearsal.session import Session
from trunkline.ar.preview.package import only_package
from trunkline.kinematics.panda.kinematics import mount_pose
from upkeep.results import recorded

SHARES = ("whole", "alignment", "mount", "arm at rest", "curling", "in curl", "in lift")


@recorded("grasp_shares")
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--package", type=Path, default=None)
    given = parser.parse_args()
    package = given.package or only_package()
    tell(varied(bench_of(package), "grasp", "single"), given.runs)


def tell(bench: Bench, runs: int) -> None:
    """Print the table of the seeds 0, 1, … that the robot has run."""
    print("| seed | " + " | ".join(SHARES) + " |")
    print("|---|" + "---:|" * len(SHARES), flush=True)
    rows = []
    for seed in range(runs):
        staged = grasp(bench, seed)
        session, (_, frames, _) = staged.session, rehearse(staged.session, staged.script)
        if session.foreseen is None or not session.tips:
            continue
        rows.append(100 * np.array(shares(session, frames)) / bench.package.geometry.length)
        print(_line(str(seed), rows[-1]), flush=True)
    print(_line("median", np.median(rows, axis=0)))


def shares(session: Session, frames: list[SessionFrame]) -> list[float]:
    """Median length, m, of each of SHARES."""
    assert session.foreseen is not None
    assert session.plan is not None
    nominal, begins = session.foreseen.preview.nominal, session.foreseen.begins
    ran = [frame for frame in frames if frame.mode == "execute" and begins <= frame.now - session.began]
    time = np.array([frame.now - session.began for frame in ran])
    tip = np.array([frame.truth.tip for frame in ran])
    mount, _ = mount_pose(np.array([frame.truth.joints for frame in ran]), session.config.mount_offset)
    shown, carried = (_at(time - begins, nominal.time, rows[0]) for rows in (nominal.tip, nominal.mount))
    seen = np.array([session.in_client_frame(place) for place in tip])
    arm = (tip - mount) - (shown - carried)
    rest, lifting = arm[0], time >= session.plan.step * dict(session.plan.phases)["lift"]
    bending = arm - rest
    parts = (seen - shown, seen - tip, mount - carried, rest[None], bending, bending[~lifting], bending[lifting])
    return [float(np.median(np.linalg.norm(part, axis=1))) for part in parts]


def _at(time: np.ndarray, times: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows (F, 3) at `times` (F,), at other times (T,); the ends are held. Shape (T, 3)."""
    return np.column_stack([np.interp(time, times, column) for column in rows.T])


def _line(name: str, row: np.ndarray) -> str:
    return f"| {name} | " + " | ".join(f"{share:.2f} %" for share in row) + " |"


if __name__ == "__main__":
    main()
