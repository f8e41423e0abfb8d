"""`python -m upkeep.readme`: write the graph, all tables of results and the pictures anew.

The README has the graph and the headline numbers; docs/report.md has the full tables.

Generated blocks stand between `<!-- name -->` and `<!-- /name -->`.
"""

import json
import re
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest
from pathlib import Path
from textwrap import fill

import networkx
import pandas as pd
from dvc.repo import Repo

from trunkline.errors import in_one_line
from trunkline.identification.evaluation.error_tables import LABELS
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.parameters.parameters import EVERY_NAME, in_writing_order
from trunkline.identification.stages import model_name
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.config import load_config
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import DECIDING, TEST
from upkeep.baseline import baseline_file, read_baseline
from upkeep.limits import Limit, lookup, metrics_folder, read_limits
from upkeep.rehearsal_table import rehearsal_table, source_words
from upkeep.results import KeptResult, block, results_index
from upkeep.truth_table import KINDS, SHIPPED, STAGES, error_table, truth_table

# where it is made, and where the READMEs show it: Git holds no pictures among the artifacts
PICTURES = {
    "artifacts/identify_control/distances.png": "docs/distances.png",
    "artifacts/reachability/maps.png": "docs/maps.png",
    "artifacts/rehearse/still.png": "docs/rehearsal.png",
    "examples/asl_motion/artifacts/identify_stiffness/paths.png": "examples/asl_motion/paths.png",
    "examples/asl_trunk/artifacts/identify_damping/paths.png": "examples/asl_trunk/paths.png",
    "examples/ftdcr/artifacts/score/errors.png": "examples/ftdcr/errors.png",
    "examples/helix/artifacts/score/errors.png": "examples/helix/errors.png",
    "examples/pairs/artifacts/identify_stiffness/paths.png": "examples/pairs/paths.png",
    "examples/soromox/artifacts/score/errors.png": "examples/soromox/errors.png",
}
EXAMPLES = ("asl_trunk",)  # folders of examples/ with releases, each a block of docs/report.md and of its own README
RESULTS_PAGE = Path("docs/report.md")

# E_internal of the paper's arm before and after identification, over 437 frames: its section "Parameter Identification"
PAPER = {"cad": "89.8 mm (17 %)", "identified": "15.8 mm (3 %)"}
MODELS = {
    "null": "baseline: mean rest shape",
    "cad": "CAD",
    "coarse": "coarse: one scalar each",
    "smooth": "identified, without capstan friction",
    "prompt": "identified, without the winches' rate limit and backlash",
    "identified": "identified",
    "noise_floor": "noise floor",
}


@dataclass(frozen=True)
class Shown:
    """A figure of a row: dotted key in metrics.json, unit, and of a count the key of how many it is of."""

    key: str
    unit: str = ""
    of: str = ""


def as_sent(at: str, targets: str) -> tuple[Shown, ...]:
    """Of commands that were sent to an arm: the same statistics of whatever arm, the bad ones beside the good."""
    return *both(f"{at}.position_error_mm"), Shown(f"{at}.beyond_1pct_unsaid", of=targets)


def both(distances: str) -> tuple[Shown, Shown]:
    """Median and 95th percentile of `distances`, mm."""
    return Shown(f"{distances}.median", "mm"), Shown(f"{distances}.p95", "mm")


# stage: [(what it is, its figures)]
RESULTS = {
    "fk_dataset": [
        (
            "FK against MuJoCo settled to rest, without friction: median",
            (Shown("mujoco_deviation_mm.median", "mm"),),
        ),
        (
            "Friction band, between where the tip stops after a pull and after a release: median / 95th percentile",
            (Shown("friction_band_mm.median", "mm"), Shown("friction_band_mm.p95", "mm")),
        ),
    ],
    "train_ik": [
        (
            "The network's commands sent to the twin without friction, tip error at rest: median / 95th percentile / "
            "targets missed by more than 1 % of length without a warning",
            as_sent("as_controls.frictionless", "as_controls.targets"),
        ),
        (
            "… to the twin with friction, sent at once",
            as_sent("as_controls.friction", "as_controls.friction.targets"),
        ),
        (
            "… to the simulated lab's arm; warned of as above, and where pulls or tilts are beyond the certificate's",
            as_sent("on_plant", "on_plant.targets"),
        ),
        (
            "… pulling by no more in all than in the session's trials at rest",
            as_sent("on_plant.within", "on_plant.within.targets"),
        ),
        ("… share of targets sent to that arm with a warning", (Shown("on_plant.doubted"),)),
        (
            "… to that arm, with a residual map from 30 poses of it: median / 95th percentile / of those within the "
            "session's pulls",
            (*both("on_plant.with_poses.position_error_mm"), *both("on_plant.with_poses.within.position_error_mm")),
        ),
        (
            "… to tips at which that arm itself rested, tip error: median / 95th percentile / of those within the "
            "session's pulls",
            (*both("on_plant.own_surface.position_error_mm"), *both("on_plant.own_surface.within.position_error_mm")),
        ),
        (
            "Part of the error across the surface of tips, which no command takes away: median / 95th percentile / of "
            "those within the session's pulls",
            (*both("on_plant.across_mm"), *both("on_plant.within.across_mm")),
        ),
    ],
    "reachability": [
        (
            "Rigid map: share of points on which inverse kinematics of the same Panda agrees",
            (Shown("rigid.accuracy"),),
        ),
        (
            "Soft maps: smallest overlap under gravity directions between the sampled ones",
            (Shown("soft.heldout_iou_min"),),
        ),
    ],
    "identify_control": [
        (
            "Identified model without capstan friction, as in the package's file, on `validate`: position / tip error",
            (Shown("smooth.validate.e_position_mm", "mm"), Shown("smooth.validate.e_tip_mm", "mm")),
        ),
    ],
    "package_unity": [
        (
            "Packed model against the identified one with all that the importer drops, in a curl: largest deviation",
            (Shown("dropped_max_deviation_mm", "mm"),),
        ),
    ],
}
GOAL = {"e_internal": 0.2, "e_position": 0.6, "e_tip": 2.0}  # % of the arm's length, of every kind of experiment
REAL_GOAL = {"e_position": 1.25}  # likewise, of a real arm


BESIDE = ("cad", "null", "null_straight", "null_held", "noise_floor")  # an identified model


def title(model: str) -> str:
    """What a column of a model is called; metrics call the baselines null models."""
    return LABELS[model].replace("null:", "baseline:")


def pipeline_graph(root: Path) -> str:
    """The stages of dvc.yaml as a mermaid flowchart; edges that follow from others are left out."""
    with Repo(str(root)) as repo:
        others = ("examples/", "rehearsal/")  # `dvc repro` alone runs neither
        stages = {s.addressing: s for s in repo.index.stages if not s.addressing.startswith(others)}
        edges = [(above.addressing, stage.addressing) for stage, above in repo.index.graph.edges]
        graph = networkx.DiGraph()
        graph.add_nodes_from(stages)
        graph.add_edges_from(edge for edge in edges if stages.keys() >= set(edge))
    reduced = networkx.transitive_reduction(graph)
    order = list(networkx.lexicographical_topological_sort(reduced, key=list(stages).index))
    names = {address: address.removesuffix(".yaml").rpartition(":")[2] for address in order}
    lines = ["```mermaid", "flowchart LR"]
    lines += [f"    {names[a]}" for a in order if not reduced.degree(a)]
    while reduced.edges:
        path = networkx.dag_longest_path(reduced, topo_order=order)
        lines.append(f"    {' --> '.join(names[stage] for stage in path)}")
        reduced.remove_edges_from(pairwise(path))
    return "\n".join([*lines, "```"])


def results_table(file: Path, results: Mapping[str, Sequence[tuple[str, Sequence[Shown]]]]) -> str:
    """The metrics in the working tree that `file` limits as a Markdown table, beside goals and the gate's bounds."""
    limits, baseline = read_limits(file), read_baseline(baseline_file(file))
    lines = ["| measure | value | goal | `make gate` |", "|---|---:|---:|---:|"]
    for stage, rows in results.items():
        metrics = _metrics(metrics_folder(file), stage)
        for what, figures in rows:
            keys = [figure.key for figure in figures]
            row_limits = [limits.get(stage, {}).get(key) for key in keys]
            before = [baseline.metrics.get(stage, {}).get(key) for key in keys]
            goals = [_goal(limit, lookup(metrics, key)) for limit, key in zip(row_limits, keys, strict=True)]
            bounds = [_bound(limit, value) for limit, value in zip(row_limits, before, strict=True)]
            lines.append(f"| {what} | {_figures(metrics, figures)} | {_joined(goals)} | {_joined(bounds)} |")
    return "\n".join(lines)


def _figures(metrics: dict | None, figures: Sequence[Shown]) -> str:
    """Figures of a row, a unit that several have in a row behind the last of them."""
    words = []
    for figure, following in zip_longest(figures, figures[1:]):
        of = f" of {_number(lookup(metrics, figure.of))}" if figure.of else ""
        unit = "" if following is not None and following.unit == figure.unit else figure.unit
        words.append(f"{_number(lookup(metrics, figure.key))}{of} {unit}".strip())
    return " / ".join(words)


def _joined(words: Sequence[str]) -> str:
    """Words of a row's figures, a dash for one that has none where another has; empty where none has."""
    return " / ".join(word or "–" for word in words) if any(words) else ""


def identification_table(root: Path) -> str:
    """Errors over all kinds on which the shipped model is scored, of the models CAD and identified, beside null model
    and noise floor; where joints have factors of their own, of the coarse model without them too."""
    metrics = _metrics(root, SHIPPED)
    factors = lookup(_metrics(root, "identify_stiffness"), "per_joint_gain")
    lines = [
        "| model | position / tip error, identify | position / tip error, validate "
        "| E_internal, identify | E_internal, validate | E_internal, paper's arm |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for model, words in MODELS.items():
        if (model == "coarse" and not factors) or lookup(metrics, model) is None:
            continue
        cells = [_pair(metrics, f"{model}.{split}.", share=True) for split in DECIDING]
        cells += [_internal(metrics, f"{model}.{split}.") for split in DECIDING]
        lines.append(f"| {words} | {' | '.join(cells)} | {PAPER.get(model, '')} |")
    return "\n".join(lines)


def parameter_table(root: Path) -> str:
    """What each stage of identification identifies, and from what, by the settings."""
    lines = ["| stage | experiments | parameters |", "|---|---|---|"]
    for stage in STAGES:
        config = load_config(IdentificationSettings, stage, root)
        kinds = ", ".join(EXPERIMENTS[kind].plural for kind in config.experiments)
        names = in_writing_order(name for name in config.parameters if name not in EVERY_NAME)
        lines.append(f"| `{stage}` | {kinds} | {', '.join(f'`{name}`' for name in names)} |")
    return "\n".join(lines)


def experiment_table() -> str:
    """The kinds of experiment, for whoever writes a session.yaml."""
    lines = ["| `experiment` | what | `level` | commands or tendon positions |", "|---|---|---|---|"]
    for name, kind in EXPERIMENTS.items():
        level = kind.level.says if kind.level else ""
        lines.append(f"| `{name}` | {kind.what} | {level} | {'needed' if kind.needs_motors else ''} |")
    return "\n".join(lines)


def score_table(root: Path) -> str:
    """Errors of the shipped model on the trials of the split test, by kind of experiment and of all together; then
    those of intermediate models, which say so."""
    metrics, rows = _metrics(root, "score"), []
    for stage in (SHIPPED, *STAGES[:-1]):
        scored = lookup(metrics, stage)
        name = "" if stage == SHIPPED else f"{model_name(stage, STAGES)}: "
        kinds = _scored_kinds(scored)
        for kind in kinds:
            rows.append(f"| {name}{KINDS[kind]} | {' | '.join(_beside(scored, f'{TEST}.by_experiment.{kind}.'))} |")
        if kinds and stage == SHIPPED:
            rows.append(f"| all of these | {' | '.join(_beside(scored, f'{TEST}.'))} |")
    goal = f"| goal | {GOAL['e_position']:g} / {GOAL['e_tip']:g} % |{' |' * len(BESIDE)} {GOAL['e_internal']:g} % |"
    return "\n".join([*_head(f"trials of `{TEST}`"), goal, *rows])


def _scored_kinds(metrics: dict | None) -> list[str]:
    """The kinds of experiment on which a model was scored."""
    scored = lookup(metrics, f"identified.{TEST}.by_experiment") or {}
    return [kind for kind in KINDS if kind in scored]


def rehearsal_block(root: Path) -> str:
    """Results of the committed runs of the rehearsal, and their code and package."""
    metrics = _metrics(root, "rehearse")
    if metrics is None:
        return "(no runs are committed yet)"
    goals = read_limits(root / "tests" / "limits.yaml")["rehearse"]
    table = rehearsal_table(metrics, goals, source_words(root, metrics), variants=True)
    stated = preview_table(metrics.get("preview"), goals)
    return "\n\n".join([table, stated] if stated else [table])


def preview_table(preview: dict | None, goals: dict[str, Limit]) -> str:
    """Whether what previews state came true, beside the goals; "" where no run had a preview."""
    coverage = lookup(preview, "coverage.at_end")
    if not coverage:
        return ""
    times = COVERAGE_TIMES
    lines = ["| statement of the preview | came true | goal |", "|---|---:|---:|"]
    radius = f"{_number(lookup(preview, 'radius_mm.median'))} mm"
    counts = [[lookup(preview, f"coverage.{name}.{key}") for key in ("inside", "runs")] for name in times]
    inside = [f"{count} of {runs}" for count, runs in counts]
    off = [_number(lookup(preview, f"tip_error_radii.{name}.median")) for name in times]
    stated = [_goal(goals.get(f"preview.coverage.{n}.share"), lookup(preview, f"coverage.{n}.share")) for n in times]
    what = f"reach: with nothing in the way, the tip ends within a radius ({radius}, median) in 9 of 10 cases: "
    what += ", ".join(times.values())
    came = f"{' / '.join(inside)}; it is {' / '.join(off)} radii off, median"
    lines.append(f"| {what} | {came} | {_joined(stated)} |")
    if cameras := lookup(preview, "cameras"):
        reached = [f"{cameras[how]['inside']} of {cameras[how]['runs']}" for how in ("without", "with")]
        goal = _goal(goals.get("preview.cameras.with.share"), cameras["with"]["share"])
        what = "reach: the tip rests within 10 mm of its target, without / with a correction by cameras"
        lines.append(f"| {what} | {' / '.join(reached)}; {cameras['farther']} led farther off by 2 mm | {goal} |")
    if previews := lookup(preview, "previews"):
        goal = _goal(goals.get("preview.agreement"), lookup(preview, "agreement"))
        came = f"{lookup(preview, 'agreed')} of {previews} as predicted"
        lines.append(f"| grasp, hand-over: whether it holds | {came} | {goal} |")
        path = lookup(preview, "path_pct_median")
        goal = _goal(goals.get("preview.path_pct_median"), path)
        lines.append(f"| grasp, hand-over: path of the tip | {_number(path)} % of length off, median | {goal} |")
    return "\n".join(lines)


def example_table(folder: Path, all_splits: bool = True) -> str:
    """An example's releases by split, beside what an identified model stands beside, and the arm's repeatability; then
    its error with each trial's own mean rest offset taken out, and that of the tip's speed 1 to 2 s after release."""
    scored = lookup(_metrics(folder, "score"), "identify_damping")
    fitted = _metrics(folder, "identify_damping")
    head, line = _head("releases")
    head += " repeatability, mm | about each trial's rest, mm | error of the late tip speed |"
    rows = [head, line + "---:|" * 3]
    fits = [(split, fitted) for split in reversed(DECIDING)] if all_splits else []
    for split, metrics in ((TEST, scored), *fits):
        scatter = [_number(lookup(metrics, f"repeatability_mm.release.{key}_mm")) for key in ("mean", "tip")]
        for words, at in (("", f"{split}."), (", without repaired trials", f"{split}.without_repaired.")):
            if not words or lookup(metrics, f"identified.{at}trials") is not None:
                cells = [*_beside(metrics, at), " / ".join(scatter) if set(scatter) != {"–"} else "–"]
                about = [lookup(metrics, f"identified.{at}e_{what}_about_rest_mm") for what in ("position", "tip")]
                late = lookup(metrics, f"identified.{at}e_late_speed_pct")
                cells += [" / ".join(map(_number, about)), _number(late) + (" %" if late is not None else "")]
                rows.append(f"| of `{split}`{words} | {' | '.join(cells)} |")
    return "\n".join(rows)


PATHS = {"identified": "identified", "prompt": "identified, no backlash", "cad": "CAD",
         "null": "baseline: mean shape", "null_straight": "baseline: straight arm"}  # fmt: skip


def path_table(folder: Path) -> str:
    """An example's static paths by split: root mean square of the tip's distance, raw and without its mean offset."""
    scored = lookup(_metrics(folder, "score"), "identify_stiffness")
    fitted = _metrics(folder, "identify_stiffness")
    what = "poses: RMS of the tip's distance, without / with its mean offset, mm"
    lines = [f"| {what} | {' | '.join(PATHS.values())} |"]
    lines.append("|---" + "|---:" * len(PATHS) + "|")
    for split, metrics in ((TEST, scored), *((split, fitted) for split in reversed(DECIDING))):
        ways = [f"{split}.e_tip_{way}_mm" for way in ("centred_rms", "rms")]
        cells = [_numbers(metrics, (f"{model}.{way}" for way in ways)) for model in PATHS]
        lines.append(f"| of `{split}` | {' | '.join(cells)} |")
    return "\n".join(lines)


# stage: [(what it is, dotted key in metrics.json, unit)], of an example
NETWORK = {
    "fk_dataset": [("FK against MuJoCo settled to rest: median", "mujoco_deviation_mm.median", "mm")],
    "train_ik": [
        ("IK, tip of settled MuJoCo: median", "as_controls.frictionless.position_error_mm.median", "mm"),
        ("… 95th percentile", "as_controls.frictionless.position_error_mm.p95", "mm"),
        ("… share of reachable poses with a warning", "as_controls.frictionless.doubted", ""),
        ("… sent at once, with the winches' backlash", "as_controls.friction.position_error_mm.median", "mm"),
        ("IK, samples held out: median", "position_error_mm.median", "mm"),
        ("… after 3 Gauss-Newton steps: median", "polished.position_error_mm.median", "mm"),
        ("… 95th percentile", "polished.position_error_mm.p95", "mm"),
    ],
    "reachability": [
        ("Soft map: share of held-out tips that it calls reachable", "soft.heldout_reachable_min", ""),
        ("… share of points 30 mm from every tip that it calls reachable", "soft.heldout_beyond_max", ""),
        ("Hybrid map: share of points inside for which a pose was found", "hybrid.found_inside", ""),
    ],
}


def network_table(folder: Path) -> str:
    """What an example's samples, network and maps are worth."""
    rows = ["| kinematics | |", "|---|---:|"]
    for stage, entries in NETWORK.items():
        metrics = _metrics(folder, stage)
        rows += [f"| {what} | {_number(lookup(metrics, key))} {unit} |" for what, key, unit in entries]
    return "\n".join(rows)


def log_table(folder: Path) -> str:
    """An example's trials of `test` by the log that they are pieces of: each model's mean position / tip error, mm."""
    file = folder / "artifacts" / "score" / "trials.csv"
    names = [LABELS[name] for name in ("identified", *BESIDE)]
    titles = " | ".join(title(name) for name in ("identified", *BESIDE))
    lines = [f"| log: position / tip error, mm | trials | {titles} |", f"|---{'|---:' * (len(names) + 1)}|"]
    if not file.is_file():
        return "\n".join(lines)
    rows = pd.read_csv(file)
    rows["log"] = rows["trial"].str.rpartition("_")[0]
    for log, group in rows.groupby("log", sort=False):
        means = group.groupby("model")[["e_position_mm", "e_tip_mm"]].mean()
        cells = [" / ".join(map(_number, means.loc[name])) if name in means.index else "–" for name in names]
        lines.append(f"| `{log}` | {group['trial'].nunique()} | {' | '.join(cells)} |")
    return "\n".join(lines)


def other_arms(examples: Path) -> str:
    """Results of the examples that are moved by motors, on trials of `test`: a line each, for a page in docs/."""
    scored = [_metrics(examples / name, "score") for name in ("asl_motion", "ftdcr")]
    moved, paths = (lookup(metrics, "identify_stiffness") for metrics in scored)
    error, share = (_number(lookup(moved, f"identified.{TEST}.e_position_{unit}")) for unit in ("mm", "pct"))
    tip = _number(lookup(paths, f"identified.{TEST}.e_tip_centred_rms_mm"))
    nulls = lookup(moved, f"null.{TEST}.e_position_mm"), lookup(paths, f"null.{TEST}.e_tip_centred_rms_mm")
    moved_null, paths_null = map(_number, nulls)
    return (
        f"[Moved by its motors](../examples/asl_motion), without and with a load: {error} mm ({share} %) on `{TEST}` "
        f"(mean shape {moved_null}).\n"
        f"The [FTDCR](../examples/ftdcr), nine tendons: tip {tip} mm RMS on `{TEST}` (its authors' simulator 9.38, "
        f"mean shape {paths_null})."
    )


EXPERIMENT_NAMES = {"reach": "reach", "follow": "follow", "grasp": "grasp", "handle": "hand-over"}
# keys of metrics of the rehearsal's coverage: when the tip was looked at
COVERAGE_TIMES = {"at_end": "at the end", "after_2s": "2 s later", "after_10s": "10 s later"}


def headline(root: Path) -> str:
    """The README's few numbers, the bad ones beside the good ones; what misses a goal is bold."""
    rehearsed = _metrics(root, "rehearse")
    goals = read_limits(root / "tests" / "limits.yaml").get("rehearse", {})
    lines = ["| | calibrated twin | for comparison |", "|---|---|---|", *_held_out_rows(root), _command_row(root)]
    lines.append(_rehearsal_row(rehearsed, goals))
    if rehearsed:
        lines += ["", fill(f"The last row: rehearsal {source_words(root, rehearsed)}.", 120)]
    return "\n".join(lines)


def _held_out_rows(root: Path) -> list[str]:
    """Errors of the shipped model on trials of `test`: of the simulated lab's arm over all kinds of experiment and of
    the worst one, and of a real arm."""
    example = f"examples/{EXAMPLES[0]}"
    lab = lookup(_metrics(root, "score"), SHIPPED)
    at, kinds = f"{TEST}.by_experiment.", _scored_kinds(lab)
    plurals = ", ".join(KINDS[kind] for kind in kinds)
    words = f"Shape / tip error in % of length, simulated lab, {{}} held-out trials ({plurals})"
    rows = [_held_out_row(words, lab, f"{TEST}.", GOAL)]
    if kinds:
        worst = max(kinds, key=lambda kind: lookup(lab, f"identified.{at}{kind}.e_tip_pct") or 0.0)
        rows.append(_held_out_row(f"… the worst kind: {{}} {KINDS[worst]}", lab, f"{at}{worst}.", GOAL))
    real = lookup(_metrics(root / example, "score"), "identify_damping")
    words = f"Shape / tip error in % of length, [a real arm]({example}), {{}} held-out trials (releases)"
    return [*rows, *_family_rows(root), _held_out_row(words, real, f"{TEST}.", REAL_GOAL)]


def _held_out_row(words: str, metrics: dict | None, at: str, goals: Mapping[str, float]) -> str:
    """A row of errors, bold where one that is shown misses its goal; `words` have braces for the number of trials."""
    errors = _pair(metrics, f"identified.{at}", share=True)
    shares = {error: lookup(metrics, f"identified.{at}{error}_pct") for error in ("e_position", "e_tip")}
    missed = any(share is not None and share > goals.get(error, share) for error, share in shares.items())
    beside = "; ".join(f"{title(name)} {_pair(metrics, f'{name}.{at}')} mm" for name in ("cad", "null", "noise_floor"))
    trials = _number(lookup(metrics, f"identified.{at}trials"))
    return f"| {words.format(trials)} | {f'**{errors}**' if missed else errors} | {beside} |"


def _family_rows(root: Path) -> list[str]:
    """Errors over simulated arms whose laws the model has not: the last row of their study's table, if it has run."""
    path = root / "docs/results/families.json"
    if not path.is_file():
        return []
    result = KeptResult.read(path)
    *_, last = (line for line in result.lines if line.startswith("|"))
    _, arms, _, position, worst_position, tip, worst_tip, null = last.strip("| ").split(" | ")
    what = f"Shape / tip error in % of length, {arms} simulated arms "
    what += "[with laws that the model lacks](docs/results/families.md)"
    stale = " (**STALE**)" if result.state(root) == "STALE" else ""
    refused = next((line for line in result.lines if line.startswith("Sessions that are refused")), "")
    more = f"; **{refused.count(' by ')} more refused**" if refused else ""
    errors = f"mean {position} / {tip} %, worst arm {worst_position} / {worst_tip} %"
    if float(worst_position) > GOAL["e_position"] or float(worst_tip) > GOAL["e_tip"]:
        errors = f"**{errors}**"
    return [f"| {what} | {errors}{stale}{more} | baseline: mean rest shape, tip {null} % |"]


def _command_row(root: Path) -> str:
    """Tip errors of the network's commands on the simulated lab's arm, beside those on the twin without and with
    friction, where they are better."""
    metrics = _metrics(root, "train_ik")

    def sent(at: str, targets: str) -> str:
        *errors, silent = as_sent(at, targets)
        counts = f"{_number(lookup(metrics, silent.key))} of {_number(lookup(metrics, targets))}; "
        counts += _percent(lookup(metrics, f"{at}.doubted"))
        return f"{_numbers(metrics, (figure.key for figure in errors))} mm ({counts})"

    twin = sent("as_controls.frictionless", "as_controls.targets")
    rubbing = sent("as_controls.friction", "as_controls.friction.targets")
    with_poses = _numbers(metrics, (figure.key for figure in both("on_plant.with_poses.position_error_mm")))
    what = "Tip error of the network's commands, median / 95th percentile "
    what += "(targets missed by more than 1 % of length without a warning; share of all with one)"
    return (
        f"| {what} | **on the simulated lab's arm: {sent('on_plant', 'on_plant.targets')}; {with_poses} mm after "
        "[30 recorded poses](docs/lab-tools.md#poses-to-record)** "
        f"| on the twin without friction: {twin}; with friction: {rubbing} |"
    )


def _rehearsal_row(metrics: dict | None, goals: Mapping[str, Limit]) -> str:
    """Success rates beside their goals."""
    rates, rate_goals = [], []
    for name, words in EXPERIMENT_NAMES.items():
        rate, goal = lookup(metrics, f"{name}.rate"), goals.get(f"{name}.rate")
        clean = lookup(metrics, f"{name}.clean.rate")
        beside = "" if clean is None else f" (within 20 mm, and no other part touched anything: {_percent(clean)})"
        rates.append(_marked(f"{words} {_percent(rate)}", goal, rate) + beside)
        rate_goals += [f"{words} ≥ {_percent(goal.target)}"] if goal and goal.target is not None else []
    return f"| Rehearsed experiments that succeed | {', '.join(rates)} | goal: {', '.join(rate_goals)} |"


def _marked(words: str, goal: Limit | None, value: float | None) -> str:
    """`words`, bold where `value` misses its goal."""
    missed = goal is not None and goal.target is not None and value is not None and goal.misses(value, goal.target)
    return f"**{words}**" if missed else words


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f} %".replace(".0 %", " %")


def _metrics(root: Path, stage: str) -> dict | None:
    path = root / "artifacts" / stage / "metrics.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def _head(what: str) -> list[str]:
    """The head of a table whose rows are of `_beside`."""
    cells = [f"{what}: position / tip error", f"{title('identified')}, % of length (mm)"]
    cells += [*(f"{title(name)}, mm" for name in BESIDE), "E_internal"]
    return [f"| {' | '.join(cells)} |", f"|---|{'---:|' * (len(cells) - 1)}"]


def _beside(metrics: dict | None, at: str) -> list[str]:
    """Position / tip error of the identified model, of CAD, baselines and the noise floor, then E_internal."""
    pairs = [_pair(metrics, f"{name}.{at}") for name in BESIDE]
    return [_pair(metrics, f"identified.{at}", share=True), *pairs, _internal(metrics, f"identified.{at}")]


def _internal(metrics: dict | None, at: str) -> str:
    """E_internal in mm and % of the arm's length."""
    millimeters, share = (_number(lookup(metrics, f"{at}e_internal_{unit}")) for unit in ("mm", "pct"))
    return f"{millimeters} mm ({share} %)"


def _numbers(metrics: dict | None, keys: Iterable[str]) -> str:
    """The figures of dotted `keys`, side by side."""
    return " / ".join(_number(lookup(metrics, key)) for key in keys)


def _pair(metrics: dict | None, at: str, share: bool = False) -> str:
    """Position / tip error in mm; with `share` in % of the arm's length first."""
    if lookup(metrics, f"{at}e_position_mm") is None:
        return "–"
    pairs = {
        unit: _numbers(metrics, (f"{at}{error}_{unit}" for error in ("e_position", "e_tip")))
        for unit in ("mm", "pct")
    }
    return f"{pairs['pct']} % ({pairs['mm']} mm)" if share else pairs["mm"]


def _goal(limit: Limit | None, value: float | None) -> str:
    """The goal of a metric whose `value` is found, with a word where that misses it."""
    if limit is None:
        return ""
    words = [f"{limit.equals}"] if limit.equals is not None else []
    if limit.target is not None:
        missed = " (missed)" if value is not None and limit.misses(value, limit.target) else ""
        words.append(f"{'≤' if limit.rises else '≥'} {_number(limit.target)}{missed}")
    words += [f"{limit.below.factor:g}× below {limit.below.key.partition('.')[0].upper()}"] if limit.below else []
    return ", ".join(words)


def _bound(limit: Limit | None, before: float | None) -> str:
    if limit is None or before is None:
        return f"{limit.equals}" if limit and limit.equals is not None else ""
    return f"{'≤' if limit.rises else '≥'} {_number(limit.bound(before))}"


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{int(value):,}" if value == int(value) else f"{value:.3g}"


def with_blocks(text: str, blocks: dict[str, str]) -> str:
    """`text` with the content of each named block replaced.

    Raises:
        ValueError: if `text` has no such block.
    """
    for name, content in blocks.items():
        block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        if not block.search(text):
            raise ValueError(f"expected a block `<!-- {name} -->` … `<!-- /{name} -->`")
        text = block.sub(lambda match, content=content: f"{match[1]}{content}\n{match[2]}", text)
    return text


def generate(root: Path) -> dict[Path, str]:
    """README.md, the examples' own, the reference of sessions and the docs, with their generated blocks as they should
    be."""
    examples = {name: example_table(root / "examples" / name) for name in EXAMPLES}
    examples |= {name: log_table(root / "examples" / name) for name in ("asl_motion", "helix", "pairs", "soromox")}
    blocks: dict[Path, dict[str, str]] = {}
    blocks[root / "README.md"] = {"pipeline": pipeline_graph(root), "headline": headline(root)}
    blocks[root / "data" / "raw" / "README.md"] = {"experiments": experiment_table()}
    blocks |= {root / "examples" / name / "README.md": {name: table} for name, table in examples.items()}
    ftdcr = root / "examples" / "ftdcr"
    blocks[ftdcr / "README.md"] = {"ftdcr": path_table(ftdcr), "network": network_table(ftdcr)}
    for page in sorted((root / "docs").rglob("*.md")):
        names = re.findall(r"^<!-- (results/\w+) -->$", page.read_text(encoding="utf-8"), re.MULTILINE)
        if names:
            blocks[page] = {name: block(root / "docs" / f"{name}.json") for name in names}
    demo = {"identification": identification_table(root), "score": score_table(root)}
    demo["results"] = results_table(root / "tests" / "limits.yaml", RESULTS)
    demo |= {name: example_table(root / "examples" / name, all_splits=False) for name in EXAMPLES}
    demo["arms"] = other_arms(root / "examples")
    blocks.setdefault(root / RESULTS_PAGE, {}).update(demo)
    blocks.setdefault(root / "docs" / "identification.md", {})["parameters"] = parameter_table(root)
    blocks.setdefault(root / "docs" / "rehearsal.md", {})["rehearsal"] = rehearsal_block(root)
    blocks[root / "docs" / "results" / "README.md"] = {"kept_results": results_index(root)}
    truth = {"truth": truth_table(root), "errors": error_table(root)}
    blocks.setdefault(root / "docs" / "results" / "intervals.md", {}).update(truth)
    return {path: with_blocks(path.read_text(encoding="utf-8"), content) for path, content in blocks.items()}


@in_one_line
def main(root: Path = Path(".")) -> int:
    """Write what `generate` says, and the pictures."""
    require_checkout(root)
    for path, text in generate(root).items():
        path.write_text(text, encoding="utf-8")
    copy_pictures(root)
    return 0


def copy_pictures(root: Path) -> None:
    """To where the READMEs show them."""
    for source, target in PICTURES.items():
        if (root / source).is_file():
            (root / target).parent.mkdir(exist_ok=True)
            shutil.copyfile(root / source, root / target)


if __name__ == "__main__":
    sys.exit(main())
