"""In how many trials a watch finds a softer arm, and how often it cries wolf: `python -m studies.watch`

The stand-in lab records the arm as it is and with all joints 5 % softer, under conditions that its session mostly
does not have, each trial with noise of its own. `trunkline.tools.monitor` takes the logs in as a lab's and scores them.
The unchanged arm's trials are put in another order for each chart: the first of each kind are its reference. Beside it
stands the demo session's, which were planned and not drawn. Trials that are scored are kept in docs/results/watch.csv,
as they take long; the charts are made anew from them.
"""

import json
import sys
import tempfile
from contextlib import redirect_stdout
from copy import deepcopy
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from demo.experiments import Experiments, MotionPlan, PullPlan
from demo.instruments import measure
from demo.laboratory import Laboratory
from demo.plants.bench import Plant
from demo.plants.choice import plant_of
from demo.plants.stranger import Stranger
from demo.record import Config
from demo.recorder import write_log, write_session
from demo.rig import ROOT
from demo.truth import Truth
from studies.rows import Rows, digest
from studies.stage_chain import require_demo
from trunkline.compute.progress import progress
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import load_config
from trunkline.recordings.trials.splits import DECIDING
from trunkline.recordings.trials.trial import read_trials
from trunkline.tools.monitor.attribution import attribute_change
from trunkline.tools.monitor.baseline import Baseline
from trunkline.tools.monitor.control_chart import Chart, chart_of
from trunkline.tools.monitor.history import read_score, score_row
from trunkline.tools.monitor.loading import load_logs
from trunkline.tools.monitor.monitor import LEARN, scorer_of
from trunkline.tools.monitor.scores import Score, Scorer

MODEL, TRIALS = Path("artifacts/identify_control/arm.xml"), Path("data/processed/filter")
SOFTER = 0.95  # of the stiffness
SEED, SEEDS = 8, 20
EACH = {"static_tilt": 160, "release": 130, "static_pull": 60, "curl": 40, "motion": 10}  # of the unchanged arm
AFTER = {"static_tilt": 3, "release": 3, "curl": 3, "static_pull": 3}  # of the softer one, a seed
PERFORMED = {  # the laboratory's method of a kind, and whether it draws
    "static_tilt": (Laboratory.tilts, True),
    "release": (Laboratory.releases, False),
    "curl": (Laboratory.curls, False),
    "static_pull": (Laboratory.pulls, False),
    "motion": (Laboratory.motions, True),
}
KINDS = tuple(PERFORMED)  # a number of its own for the draws of each
TELLING = ("static_tilt", "release")  # kinds that tell stiffness well
BEFORE = 8  # trials of the unchanged arm with which a chart begins
LATEST = 3  # trials within which a change should be found


def planned(kind: str, base: Experiments, rng: np.random.Generator) -> Experiments:
    """One trial of a kind under conditions that are drawn."""
    empty = replace(base, tilts=[], release_directions=[], curl_levels=[], pulls=[], motions=[], loads=[])
    empty.tilt_repeats = 1
    if kind == "static_tilt":  # half of them as the session has them
        usual = float(rng.choice(base.tilts[1:]))
        return replace(empty, tilts=[usual if rng.random() < 0.5 else float(rng.uniform(25, 100))])
    if kind == "release":
        factor = float(rng.uniform(1.0, 1.3))
        return replace(empty, release_directions=[float(rng.uniform(0, 360))], release_factors=[factor])
    if kind == "curl":
        tendons = [[1], [2], [3], [1, 2], [2, 3], [1, 3]][rng.integers(6)]
        return replace(empty, curl_levels=[float(rng.uniform(20, 100))], curl_tendons=[tendons])
    if kind == "static_pull":
        levels: list[float | None] = [None, None, None]
        for tendon in rng.choice(3, size=rng.integers(1, 3), replace=False):
            levels[tendon] = float(rng.uniform(10, 55))
        return replace(empty, pulls=[PullPlan(levels, bool(rng.random() < 0.5))])
    frequencies = np.sort(rng.uniform(0.3, 1.8, 3)).round(2).tolist()
    return replace(empty, motions=[MotionPlan(frequencies, float(rng.uniform(15, 40)), float(rng.uniform(-4, 1)))])


def done(lab: Laboratory, kind: str, plan: Experiments, rng: np.random.Generator) -> Truth:
    """The trial of a kind."""
    perform, draws = PERFORMED[kind]
    return perform(lab, plan, *([rng] if draws else []))[0]


def softened(plant: Plant) -> Plant:
    """The same arm, all of its joints softer: what is elastic, what relaxes and what keeps a memory alike."""
    assert isinstance(plant, Stranger), "the demo's arm"
    plant.links = plant.links._replace(stiffness=SOFTER * plant.links.stiffness)
    return plant


def scored(lab: Laboratory, config: Config, kind: str, rng: np.random.Generator, scorer: Scorer) -> Score:
    """A trial of a kind, recorded as a log and taken in from there."""
    truth = done(lab, kind, planned(kind, config.experiments, rng), rng)
    measurement = measure(truth, config.instruments, rng)
    with tempfile.TemporaryDirectory() as name:
        session = Path(name)
        write_log(session / f"{truth.name}.mcap", measurement)
        write_session(session, [measurement], config.instruments)
        taken = load_logs(session, {f"{truth.name}.mcap"}, Path("."))
    if not taken.trials:
        raise InputError(next(iter(taken.refused.values())))
    return scorer.score(taken.trials[truth.name])


def wanted() -> list[tuple[str, str, int]]:
    """Arm, kind and number of every trial, in the order in which they are done; the unchanged arm's are mixed."""
    after = [("softer", kind, i) for kind, each in AFTER.items() for i in range(each * SEEDS)]
    before = [("unchanged", kind, i) for kind, each in EACH.items() for i in range(each)]
    return after + [before[i] for i in np.random.default_rng(SEED).permutation(len(before))]


def collect(rows: Rows, trials: list[tuple[str, str, int]], scorer: Scorer) -> None:
    """Record and score what is not among the rows yet."""
    config = load_config(Config, "record", ROOT)
    tracked = [number - 1 for number in config.arm.tracked]
    plants = {"unchanged": plant_of(config), "softer": softened(plant_of(config))}
    labs = {arm: Laboratory(plant, config.experiments.mount_position, tracked) for arm, plant in plants.items()}
    known = rows.read()
    with redirect_stdout(sys.stderr), progress(len(trials), "watch", "trials") as bar:
        for arm, kind, index in trials:
            key = f"{arm}_{kind}_{index}"
            if key not in known:
                draw = [SEED, list(labs).index(arm), KINDS.index(kind), index]
                try:
                    score = scored(labs[arm], config, kind, np.random.default_rng(draw), scorer)
                    rows.add(key, arm=arm, number=index, told=packed(score))
                except InputError as error:  # refused by what looks over logs, as a lab's would be
                    rows.add(key, arm=arm, number=index, told=f"refused: {error}")
            bar.update(1, trial=key)


def packed(score: Score) -> str:
    """A score in few bytes: the curvature is symmetric."""
    row = score_row(score)
    upper = score.curvature[np.triu_indices(len(score.slope))]
    row |= {"slope": [f"{value:.5g}" for value in score.slope], "curvature": [f"{value:.5g}" for value in upper]}
    return json.dumps({"trial": score.name} | row)


def unpacked(text: str) -> Score:
    row = json.loads(text)
    row["slope"] = [float(value) for value in row["slope"]]
    upper = np.zeros((len(row["slope"]),) * 2)
    upper[np.triu_indices(len(upper))] = [float(value) for value in row["curvature"]]
    row["curvature"] = upper + np.triu(upper, 1).T
    return read_score(row)


def referred(rows: Rows, scorer: Scorer) -> list[Score]:
    """Scores of the session's trials that may decide."""
    trials, known = read_trials(TRIALS, DECIDING), rows.read()
    with redirect_stdout(sys.stderr), progress(len(trials), "reference", "trials") as bar:
        for index, trial in enumerate(trials):
            if f"reference_{trial.name}" not in known:
                rows.add(f"reference_{trial.name}", arm="reference", number=index, told=packed(scorer.score(trial)))
            bar.update(1, trial=trial.name)
    known = rows.read()
    return [unpacked(known[f"reference_{trial.name}"]["told"]) for trial in trials]


def false_alarms(charts: list[Chart], rests: list[list[Score]], words: str, names: tuple[str, ...]) -> list[str]:
    """Of charts over the trials of the unchanged arm that are no reference, begun anew after each alarm."""
    lines = []
    kinds = {"of all kinds, mixed": KINDS} | {f"`{kind}` alone": (kind,) for kind in TELLING}
    for mixture, chosen in kinds.items():
        alarms, count = [], 0
        for empty, rest in zip(charts, rests, strict=True):
            chart, own = deepcopy(empty), [score for score in rest if score.kind in chosen]
            chart.restart = True
            found = [charted.alarms for charted in map(chart.add, own)]
            alarms.append([one for one in found if one])
            count += len(own)
        number = sum(map(len, alarms))
        who = ", ".join(sorted({names[p] for found in alarms for one in found for p in one})) or "–"
        often = f"{count / number:.0f}" if number else f"more than {count}"
        quiet = f"{sum(not found for found in alarms)} of {len(charts)}"
        lines.append(f"| {words} | {mixture} | {count} | {number} | {often} | {quiet} | {who} |")
    return lines


def found_lines(
    charts: list[Chart], rests: list[list[Score]], softer: dict[str, dict[int, Score]], words: str, names
) -> list[str]:
    """In how many trials of the softer arm each kind of trial finds it, and what is said to have changed."""
    lines = []
    mixed = {"tilts and releases in turn": ("static_tilt", "release", "static_tilt")}
    streams = mixed | {f"`{kind}` alone": (kind,) * LATEST for kind in AFTER}
    for mixture, kinds in streams.items():
        cases = [
            (empty, case) for seed, (empty, rest) in enumerate(zip(charts, rests, strict=True))
            if (case := stream(seed, kinds, rest, softer)) is not None
        ]  # fmt: skip
        if not cases:
            continue
        found = [outcome(empty, case) for empty, case in cases]
        alarmed = [(when, chart) for when, chart in found if when]
        told = [(when, attribute_change(c.suspects(), c.baseline, list(c.lines))) for when, c in alarmed]
        cells = [str(sum(when == n for when, _ in found)) for n in range(1, LATEST + 1)]
        cells.append(str(sum(not when for when, _ in found)))
        right = [one for _, one in told if names[one.best.parameter] == "stiffness"]
        cells.append(f"{len(right)} of {len(told)}")
        true = float(np.log(SOFTER))
        held = sum(abs(one.best.size - true) <= one.best.half_width for one in right)
        size = f"{100 * np.expm1(np.median([one.best.size for one in right])):+.1f} %" if right else "–"
        cells += [size, f"{held} of {len(right)}"]
        cells.append(", ".join(sorted({names[c.parameter] for one in right for c in one.alike})) or "–")
        lines.append(f"| {words} | {mixture} | {len(cases)} | {' | '.join(cells)} |")
    return lines


def stream(
    seed: int, kinds: tuple[str, ...], rest: list[Score], softer: dict[str, dict[int, Score]]
) -> tuple[list[Score], list[Score]] | None:
    """Trials of the unchanged arm, drawn, and those of the softer one that follow; None where they are not done."""
    rng = np.random.default_rng([SEED, seed])
    places = {kind: count(seed * AFTER[kind]) for kind in kinds}
    after = [score for kind in kinds if (score := softer[kind].get(next(places[kind]))) is not None]
    usual = [score for score in rest if score.kind in kinds]
    if len(after) < len(kinds) or len(usual) < BEFORE:
        return None
    return [usual[i] for i in rng.choice(len(usual), BEFORE, replace=False)], after


def outcome(empty: Chart, case: tuple[list[Score], list[Score]]) -> tuple[int, Chart]:
    """After how many trials of the softer arm the alarm came, 0 for none of them, and the chart up to there."""
    chart = deepcopy(empty)
    for score in case[0]:
        if chart.add(score).alarms:  # a false one, counted elsewhere: the chart begins anew
            chart = deepcopy(empty)
    for number, score in enumerate(case[1], 1):
        if chart.add(score).alarms:
            return number, chart
    return 0, chart


def report(reference: list[Score], trials: list, rows: dict[str, dict], scorer: Scorer) -> None:
    """What the scores so far say."""
    names = scorer.parameters
    told = {key: str(rows[name]["told"]) for key in trials if (name := "_".join(map(str, key))) in rows}
    refused = [text for text in told.values() if text.startswith("refused")]
    scores = {key: unpacked(text) for key, text in told.items() if not text.startswith("refused")}
    unchanged = [score for (arm, _, _), score in scores.items() if arm == "unchanged"]
    softer = {kind: {i: s for (arm, k, i), s in scores.items() if (arm, k) == ("softer", kind)} for kind in AFTER}
    orders = [np.random.default_rng([SEED, seed]).permutation(len(unchanged)) for seed in range(SEEDS)]
    mixed = [[unchanged[i] for i in order] for order in orders]
    firsts = [[s for kind in KINDS for s in [s for s in own if s.kind == kind][:LEARN]] for own in mixed]
    seen, wolf = [], []
    for words, references in (("as they come", firsts), ("as planned", [reference] * SEEDS)):
        known = [{id(score) for score in own} for own in references]
        rests = [[score for score in own if id(score) not in ids] for own, ids in zip(mixed, known, strict=True)]
        made = {id(own): chart_of(Baseline(own), len(names)) for own in references}
        charts = [made[id(own)] for own in references]
        seen += found_lines(charts, rests, softer, words, names)
        wolf += false_alarms(charts, rests, words, names)
    heads = ["reference", "trials of the softer arm", "charts", *(f"found in {n}" for n in range(1, LATEST + 1))]
    heads += ["later or not", "named stiffness", "said to be, median", "± holds it", "not told apart from"]
    print("\n".join([f"| {' | '.join(heads)} |", "|---|---|" + "---:|" * (len(heads) - 3) + "---|", *seen]))
    heads = ["reference", "trials of the unchanged arm", "trials", "false alarms", "one in", "charts without any"]
    heads.append("by the charts of")
    print("\n".join([f"\n| {' | '.join(heads)} |", "|---|---|---:|---:|---:|---:|---|", *wolf]))
    print(f"\nrefused as logs: {len(refused)} of {len(told)} trials")
    print(f"reference: as they come, the first {LEARN} of each kind; as planned, {len(reference)} of the session")


@in_one_line
def main() -> int:
    require_demo(MODEL)
    scorer = scorer_of(MODEL, Path("."))
    lab = [*sorted(Path("demo").rglob("*.py")), ROOT / "conf"]
    rows = Rows("watch", digest((SEED, SOFTER, scorer.parameters), MODEL, TRIALS, *lab), "trial")
    with threadpool_limits(1, user_api="blas"):
        reference = referred(rows, scorer)
        trials = wanted()
        collect(rows, trials, scorer)
        with rows.recorded(keep=True):
            report(reference, trials, rows.read(), scorer)
    return 0


if __name__ == "__main__":
    sys.exit(main())
