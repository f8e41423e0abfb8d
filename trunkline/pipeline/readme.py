"""`python -m trunkline.pipeline.readme`: write the graph, all tables of results and the pictures anew.

Generated blocks stand between `<!-- name -->` and `<!-- /name -->`.
"""

import json
import re
import shutil
import sys
from pathlib import Path

import networkx
from dvc.repo import Repo

from trunkline.errors import in_one_line
from trunkline.pipeline.baseline import baseline_file, read_baseline
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.lab_table import lab_table
from trunkline.pipeline.limits import Limit, lookup, metrics_folder, read_limits
from trunkline.pipeline.results import block

# where it is made, and where the READMEs show it: Git holds no pictures among the artifacts
PICTURES = {
    "artifacts/identify_control/distances.png": "docs/distances.png",
    "artifacts/reachability/maps.png": "docs/maps.png",
    "examples/asl_trunk/artifacts/identify_damping/paths.png": "examples/asl_trunk/paths.png",
}
EXAMPLES = ("asl_trunk",)  # folders of examples/, each a block of the README and of its own README

# E_internal of the paper's arm before and after identification, over 437 frames: its section "Parameter Identification"
PAPER = {"cad": "89.8 mm (17 %)", "identified": "15.8 mm (3 %)"}
MODELS = {"cad": "CAD", "coarse": "coarse: one scalar each", "identified": "identified: with factors"}

# stage: [(what it is, dotted key in metrics.json, unit)]; trials are of the split `validate`
RESULTS = {
    "identify_stiffness": [
        ("Static tilts: E_internal", "identified.validate.e_internal_mm", "mm"),
        ("… mean position error", "identified.validate.e_position_mm", "mm"),
    ],
    "identify_damping": [
        ("Releases: E_internal", "identified.validate.e_internal_mm", "mm"),
        ("… of the arm's length", "identified.validate.e_internal_pct", "%"),
        ("… mean position error", "identified.validate.e_position_mm", "mm"),
    ],
    "identify_control": [
        ("Releases and curls: E_internal", "identified.validate.e_internal_mm", "mm"),
        ("… of the arm's length", "identified.validate.e_internal_pct", "%"),
        ("… mean position error", "identified.validate.e_position_mm", "mm"),
        ("… E_internal of the CAD model", "cad.validate.e_internal_mm", "mm"),
    ],
    "fk_dataset": [
        ("Equilibria in the data set", "samples", ""),
        ("FK against MuJoCo settled to rest: median", "mujoco_deviation_mm.median", "mm"),
        ("… largest", "mujoco_deviation_mm.max", "mm"),
    ],
    "train_ik": [
        ("The network's commands sent to MuJoCo until the arm rests, tip error: median",
         "as_controls.frictionless.position_error_mm.median", "mm"),
        ("… 95th percentile", "as_controls.frictionless.position_error_mm.p95", "mm"),
        ("… with friction, as the arm swings: median", "as_controls.friction.position_error_mm.median", "mm"),
        ("… 95th percentile", "as_controls.friction.position_error_mm.p95", "mm"),
        ("… seconds to rest, 95th percentile", "as_controls.friction.seconds_to_rest.p95", "s"),
        ("The same by forward kinematics, 24,000 held-out samples: median", "position_error_mm.median", "mm"),
        ("… 95th percentile", "position_error_mm.p95", "mm"),
    ],
    "reachability": [
        ("Rigid map: share of points on which IK agrees that knows nothing of it", "rigid.accuracy", ""),
        ("Soft maps: smallest overlap half-way between their angles", "soft.heldout_iou_min", ""),
    ],
    "package_unity": [
        ("Rules of the Unity importer broken", "rule_violations", ""),
        ("Packed model against the calibrated one: largest deviation", "roundtrip_max_deviation_mm", "mm"),
    ],
}


EXAMPLE_RESULTS = {
    "identify_damping": [
        ("Releases of `validate`: mean position error", "identified.validate.e_position_mm", "mm"),
        ("… of the arm's length", "identified.validate.e_position_pct", "%"),
        ("… E_internal", "identified.validate.e_internal_mm", "mm"),
        ("… of the arm's length", "identified.validate.e_internal_pct", "%"),
        ("Releases of `identify`: mean position error", "identified.identify.e_position_mm", "mm"),
    ],
}


def pipeline_graph(root: Path) -> str:
    """The stages of dvc.yaml as a mermaid flowchart and a table; edges that follow from others are left out."""
    with Repo(str(root)) as repo:
        stages = {s.addressing: s for s in repo.index.stages if not s.addressing.startswith("examples/")}
        edges = [(above.addressing, stage.addressing) for stage, above in repo.index.graph.edges]
        graph = networkx.DiGraph()
        graph.add_nodes_from(stages)
        graph.add_edges_from(edge for edge in edges if edge[0] in stages)
    reduced = networkx.transitive_reduction(graph)
    order = list(networkx.lexicographical_topological_sort(reduced, key=list(stages).index))
    names = {address: address.removesuffix(".yaml").rpartition(":")[2] for address in order}
    lines = ["```mermaid", "flowchart LR"]
    lines += [f"    {names[a]}" for a in order if not reduced.degree(a)]
    lines += [f"    {names[a]} --> {names[b]}" for a in order for b in order if reduced.has_edge(a, b)]
    lines += ["```", "", "| stage | what it does |", "|---|---|"]
    lines += [f"| `{names[a]}` | {stages[a].desc} |" for a in order]
    return "\n".join(lines)


def results_table(file: Path, results: dict[str, list[tuple[str, str, str]]]) -> str:
    """The metrics in the working tree that `file` limits as a Markdown table, beside goals and the gate's bounds."""
    limits, baseline = read_limits(file), read_baseline(baseline_file(file))
    lines = ["| measure | found | goal | `make gate` |", "|---|---:|---:|---:|"]
    for stage, rows in results.items():
        path = metrics_folder(file) / "artifacts" / stage / "metrics.json"
        metrics = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
        for what, key, unit in rows:
            found = f"{_number(lookup(metrics, key))} {unit}".strip()
            limit, before = limits.get(stage, {}).get(key), baseline.metrics.get(stage, {}).get(key)
            lines.append(f"| {what} | {found} | {_goal(limit)} | {_bound(limit, before)} |")
    return "\n".join(lines)


def identification_table(root: Path) -> str:
    """E_internal and mean position error over releases and curls, of the models CAD, coarse and identified."""
    path = root / "artifacts" / "identify_control" / "metrics.json"
    metrics = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    lines = [
        "| model | E_internal, identify | E_internal, validate | position error, identify "
        "| position error, validate | E_internal, paper's arm |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for model, words in MODELS.items():
        cells = []
        for error in ("e_internal", "e_position"):
            for split in ("identify", "validate"):
                millimetres, share = (lookup(metrics, f"{model}.{split}.{error}_{unit}") for unit in ("mm", "pct"))
                cells.append(f"{_number(millimetres)} mm ({_number(share)} %)")
        lines.append(f"| {words} | {' | '.join(cells)} | {PAPER.get(model, '')} |")
    return "\n".join(lines)


def _goal(limit: Limit | None) -> str:
    if limit is None:
        return ""
    words = [f"{limit.equals}"] if limit.equals is not None else []
    words += [f"≤ {_number(limit.max)}"] if limit.max is not None else []
    words += [f"≥ {_number(limit.min)}"] if limit.min is not None else []
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
    """README.md, the examples' own and the pages on results, with their generated blocks as they should be."""
    examples = {}
    for name in EXAMPLES:
        folder = root / "examples" / name
        examples[name] = results_table(folder / "limits.yaml", EXAMPLE_RESULTS)
    results = results_table(root / "tests" / "limits.yaml", RESULTS)
    own = {"pipeline": pipeline_graph(root), "identification": identification_table(root), "results": results}
    blocks = {root / "README.md": own | examples}
    blocks |= {root / "examples" / name / "README.md": {name: table} for name, table in examples.items()}
    for page in sorted((root / "docs").rglob("*.md")):
        names = re.findall(r"^<!-- (results/\w+) -->$", page.read_text(encoding="utf-8"), re.MULTILINE)
        if names:
            blocks[page] = {name: block(root / "docs" / f"{name}.json") for name in names}
    blocks.setdefault(root / "docs" / "results" / "intervals.md", {})["lab"] = lab_table(root)
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
