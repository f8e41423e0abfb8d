"""What suggestions are worth, on the stand-in lab: `python -m benchmarks.suggest [--seeds N]`

Every seed is another arm of the lab, with noise of its own, and the same three trials to begin with. Then trials are
added one after the other: those that `trunkline.tools.design` names after every fit, for the widest intervals and for
the tip; as many drawn at random from the same candidates; and the rest of the paper's list in its order. After each,
the stages `identify_stiffness` and `identify_damping` are fitted as params.yaml says, by least squares from the CAD
model, and the twin is held against trials that no one may choose. A seed is a row of docs/results/suggest.csv as soon
as it is done; stopped, the benchmark goes on from there.
"""

import argparse
import contextlib
import io
import sys
from dataclasses import dataclass, field, replace
from itertools import count, islice
from pathlib import Path

import mujoco
import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.suggest_lab import Lab, fixed_list, held_out, started
from demo.plants.choice import plant_of
from demo.rig import ROOT, Config
from studies.rows import Rows, digest
from trunkline.errors import in_one_line
from trunkline.identification.evaluation.evaluation import replay
from trunkline.identification.fit.certainty import certainty
from trunkline.identification.fit.identify import values_of, with_parameters
from trunkline.identification.fit.search import descend
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.fit.setup import set_up, with_every
from trunkline.identification.simulate.experiment import Experiment, prepare
from trunkline.identification.simulate.loss import position_error
from trunkline.model.arm.kinds import described_arm
from trunkline.pipeline.config import load_config, load_folder, settings_of
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.trial import Trial
from trunkline.tools.design.candidates import Candidate, candidates
from trunkline.tools.design.goals import Goal, weights_for
from trunkline.tools.design.information import stage_information
from trunkline.tools.design.ranking import suggest
from trunkline.tools.design.settings import Recordable
from upkeep.results import recorded

STAGES = ("identify_stiffness", "identify_damping")
KINDS = ("static_tilt", "release", "static_pull")
SEEDS, ADDED, FRAMES, SHARE = 20, 4, 90, 0.005
COARSER = 2.0  # times the model's time step, in releases
SUGGESTED: tuple[Goal, ...] = ("intervals", "tip")


@dataclass
class State:
    """After a fit. off: mean position error of the held-out trials, mm, by kind. width: mean of the 95 % intervals over
    their ranges, each counted as 1 at most, by the jackknife. model: after both stages."""

    off: dict[str, float]
    width: float
    model: mujoco.MjModel

    @property
    def error(self) -> float:
        """Mean over kinds, mm."""
        return float(np.mean(list(self.off.values())))


@dataclass
class Bench:
    """An arm, what it is identified with, and the fits that are done, by the names of their trials."""

    lab: Lab
    cad: mujoco.MjModel
    settings: dict[str, IdentificationSettings]
    grid: Recordable
    known: dict[tuple[str, ...], State] = field(default_factory=dict)

    def state(self, chosen: list[Candidate]) -> State:
        """Of the twin that is identified from these trials."""
        key = tuple(sorted(one.name for one in chosen))
        if key not in self.known:
            self.known[key] = fitted(self.cad, self.settings, self.lab.trials(chosen), self.lab.trials(held_out()))
        return self.known[key]

    def suggested(self, chosen: list[Candidate], offered: list[Candidate], goal: Goal) -> Candidate:
        """The next, by the twin that is identified so far."""
        model, trials = self.state(chosen).model, self.lab.trials(chosen)
        stages = [
            stage_information(stage, config, model, trials, offered, self.grid, SHARE)
            for stage, config in self.settings.items()
        ]
        weights = weights_for(goal, stages, model, self.grid)
        repeated = set().union(*(stage.repeated for stage in stages))
        return suggest(stages, weights, [one for one in offered if one.name not in repeated], 1)[0].candidate


def fitted(
    cad: mujoco.MjModel, settings: dict[str, IdentificationSettings], own: list[Trial], others: list[Trial]
) -> State:
    """Both stages one after the other, each scored on the kinds that it reads."""
    model, widths, off = cad, [], {}
    for config in settings.values():
        config = with_every(config, model)
        seen = [trial for trial in own if trial.experiment in config.experiments]
        model, experiments, fit = set_up(config, seen, model)
        factor = 1.0 if all(is_static(e.kind) for e in experiments) else COARSER
        problem = fit.problem(model, [_short(e) for e in experiments], factor)
        found = descend(problem, problem.start(), config.polish.iterations, config.polish.tolerance, lambda best: None)
        assert found.linear is not None, "least squares ends on its own linearisation"
        low, high = problem.bounds()
        shares = certainty(found.linear).half_width / (0.5 * (high - low))
        shares = np.where(np.diag(found.linear.normals().sum(axis=0)) > 0, shares, np.inf)
        widths += np.minimum(np.nan_to_num(shares, nan=np.inf), 1.0).tolist()
        model = with_parameters(model, values_of(fit.parameters, found.vector))
        mujoco.mj_setConst(model, mujoco.MjData(model))
        for kind in config.experiments:
            scored = [trial for trial in others if trial.experiment == kind]
            if scored:
                unseen = [_short(prepare(trial, model, config.frames, config.command_delay)) for trial in scored]
                off[kind] = _mean_error(model, unseen, fit.segments)
    return State(off, float(np.mean(widths)), model)


def _short(experiment: Experiment) -> Experiment:
    return experiment if is_static(experiment.kind) else experiment.shortened(FRAMES)


def _mean_error(model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...]) -> float:
    """Mean position error, mm; of what finds no rest, how far the arm's points are from the base."""
    errors = []
    for found, e in zip(replay(model, experiments, segments).positions, experiments, strict=True):
        simulated = np.where(np.isfinite(found), found, 0.0)
        errors.append(float(position_error(simulated, e.positions, e.measured)))
    return 1e3 * float(np.mean(errors))


def seed_rows(seed: int, cad: mujoco.MjModel, settings, grid: Recordable) -> dict[str, list[State]]:
    """By method, the state at first and after each trial that was added."""
    lab_settings = load_config(Config, "record", ROOT)
    lab_settings.seed = 1000 + seed
    plant = plant_of(lab_settings)
    lab = Lab(plant, [number - 1 for number in lab_settings.arm.tracked], seed, cad)
    bench = Bench(lab, cad, settings, grid)
    first, listed = started(), fixed_list()
    every = candidates(grid, cad, KINDS, FRAMES)
    drawn = [every[i] for i in np.random.default_rng(seed).permutation(len(every))[:ADDED]]
    lab.trials([*first, *listed, *drawn, *held_out()])  # all at once, as that is quicker
    paths = {}
    for method, added in (("the paper's list", listed), ("random", drawn)):
        paths[method] = [bench.state([*first, *added[:number]]) for number in range(len(added) + 1)]
        _say(seed, method, added, paths[method])
    for goal in SUGGESTED:
        added: list[Candidate] = []
        while len(added) < ADDED:
            left = [one for one in every if one.name not in {other.name for other in added}]
            added.append(bench.suggested([*first, *added], left, goal))
        method = f"suggested, for {goal}"
        paths[method] = [bench.state([*first, *added[:number]]) for number in range(len(added) + 1)]
        _say(seed, method, added, paths[method])
    return paths


def _say(seed: int, method: str, added: list[Candidate], states: list[State]) -> None:
    told = " ".join(f"{state.error:.1f}" for state in states)
    names = ", ".join(one.name for one in added)
    print(f"seed {seed}: {method}: {told} mm: {names}", file=sys.stderr, flush=True)


def table_lines(rows: list[dict], methods: list[str], added: int) -> list[str]:
    """After each trial, over seeds: the error's median and worst, and the median width of the intervals."""
    lines = ["| trials added | " + " | ".join(methods) + " |", "|---:|" + "---:|" * len(methods)]
    for number in range(added + 1):
        cells = []
        for method in methods:
            key = f"{method} {number}"
            if f"{key} error" not in rows[0]:
                cells.append("")
                continue
            off, width = (np.array([float(row[f"{key} {what}"]) for row in rows]) for what in ("error", "width"))
            cells.append(f"{np.median(off):.1f} ({off.max():.1f}) mm / {100 * np.median(width):.0f} %")
        lines.append(f"| {number} | {' | '.join(cells)} |")
    return lines


def reached_lines(rows: list[dict], methods: list[str], listed: int) -> list[str]:
    """In how many seeds each method is as near as the whole list with at most half of its trials."""
    half, lines = listed // 2, []
    for method in methods:
        numbers = [n for n in range(half + 1) if f"{method} {n} error" in rows[0]]
        firsts = []
        for row in rows:
            last = float(row[f"the paper's list {listed} error"])
            firsts.append(next((n for n in numbers if float(row[f"{method} {n} error"]) <= last), None))
        done = [n for n in firsts if n is not None]
        middle = f", the median of them with {np.median(done):g}" if done else ""
        lines.append(
            f"{method}: as near as the whole list of {listed} with at most {half} trials in {len(done)} of {len(rows)} "
            f"seeds{middle}"
        )
    return lines


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.suggest", description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, help=f"stop after so many of {SEEDS}")
    arguments = parser.parse_args()
    grid = replace(load_folder(Recordable, Path("conf/suggest")), loads=[])
    settings = {stage: settings_of(stage) for stage in STAGES}
    cad = described_arm(settings_of("build_mjcf"), Path("conf")).spec.compile()
    lab = [*sorted(Path("demo/plants").glob("*.py")), ROOT / "conf"]
    made_of = digest((settings, grid, ADDED, FRAMES, SHARE), *lab)
    rows = Rows("suggest", made_of, "seed")
    with threadpool_limits(1, user_api="blas"):
        for seed in islice(count(), len(rows.read()), arguments.seeds):
            with contextlib.redirect_stdout(io.StringIO()):
                paths = seed_rows(seed, cad, settings, grid)
            cells = {}
            for method, states in paths.items():
                for number, state in enumerate(states):
                    key = f"{method} {number}"
                    cells |= {f"{key} error": state.error, f"{key} width": state.width}
                    cells |= {f"{key} {kind}": off for kind, off in state.off.items()}
            rows.add(str(seed), **cells)
    kept = rows.read()
    methods = ["the paper's list", "random", *(f"suggested, for {goal}" for goal in SUGGESTED)]
    with recorded("suggest", keep=bool(kept), origin=rows.origin):
        found, listed = list(kept.values()), len(fixed_list())
        first = f"{len(found)} arms, {len(started())} trials at first"
        print(f"{first}; off: median (worst) / intervals over their ranges: median\n")
        print("\n".join(table_lines(found, methods, listed)))
        print("\n".join(reached_lines(found, methods, listed)))
        if line := rows.attempts():
            print(line)
    return 0


if __name__ == "__main__":
    sys.exit(main())
