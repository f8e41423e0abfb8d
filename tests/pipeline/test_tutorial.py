"""docs/tutorial.md: its verbs, options, stages and files exist, and what it does to settings does it."""

import argparse
import re
import shlex
import subprocess
from importlib import import_module

import pytest
import yaml
from omegaconf import OmegaConf

from tests.support.folders import ROOT
from trunkline.__main__ import HELP, VERBS
from trunkline.recordings.trials.splits import DECIDING, TEST

PAGE = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```sh\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
COMMANDS = [line for block in BLOCKS for line in block.splitlines()]
COMMANDS += re.findall(r"`(trunkline [^`]+|dvc [a-z]+ [^`]+|make \w+)`", PAGE)


def words_of(program: str) -> list[list[str]]:
    """What follows a program's name, of each of its commands."""
    return [shlex.split(command)[1:] for command in COMMANDS if command.split()[0] == program]


def test_it_has_ten_steps_and_commands_in_each():
    steps = re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]
    assert [int(step.split(".")[0]) for step in steps[:10]] == list(range(1, 11))
    assert all("```sh" in step for step in steps)


def test_its_verbs_and_options_are_the_command_s(monkeypatch, tmp_path):
    """Parsed by the verbs' own parsers, which end there."""
    commands = [words for words in words_of("trunkline") if words[0] not in (*HELP, "VERB")]
    assert {words[0] for words in commands} >= {"inspect", "import-motive", "describe", "check", "report", "evaluate"}
    parse = argparse.ArgumentParser.parse_args

    class Parsed(Exception):
        pass

    def parse_and_end(parser, arguments=None, namespace=None):
        parse(parser, arguments, namespace)
        raise Parsed

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse_and_end)
    for verb, *arguments in commands:
        if ">" in arguments:
            arguments = arguments[: arguments.index(">")]
        with pytest.raises(Parsed):
            import_module(VERBS[verb].module).main(arguments)


def test_its_files_exist():
    """As modules and targets do, of all pages: test_docs.py."""
    copied = [words[0].replace("{spiral,mine}", "spiral") for words in words_of("cp") if words[0].startswith("conf/")]
    assert copied
    assert all((ROOT / name).is_file() for name in copied)
    pipeline = (ROOT / "dvc.yaml").read_text()
    assert {"artifacts/report", "artifacts/ingest/quality.png", "artifacts/identify_control"} <= set(
        re.findall(r"artifacts/[\w/]+(?:\.png)?", PAGE.replace("/certificate.html", "").replace("/arm.xml", ""))
    )
    for name in re.findall(r"artifacts/[\w/]+\.\w+", PAGE):
        assert name in pipeline, name


def test_its_edit_of_the_settings_chooses_session_and_arm_and_no_rig(tmp_path):
    (edit,) = [command for command in COMMANDS if command.startswith("sed") and "params.yaml" in command]
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    subprocess.run(shlex.split(edit), cwd=tmp_path, check=True)
    before, after = OmegaConf.load(ROOT / "params.yaml"), OmegaConf.load(tmp_path / "params.yaml")
    assert (after.ingest.session, after.build_mjcf.arm, after.train_ik.rig) == ("mine", "mine", None)
    assert (after.report.session, after.report.arm, after.report.rig) == ("mine", "mine", None)
    for name, value in (("session", "demo"), ("arm", "spiral")):
        section = "ingest" if name == "session" else "build_mjcf"
        after[section][name] = value
    after.train_ik.rig = before.train_ik.rig
    after.report = before.report
    assert after == before


def test_its_edits_of_the_session_make_three_splits_of_every_kind(tmp_path):
    """Of the demo's logs that it copies, as `inspect` proposes them: the last of each kind for `validate`."""
    tables = [ROOT / f"artifacts/{stage}/trials.csv" for stage in ("identify_stiffness", "identify_control", "score")]
    names = {line.split(",")[0] for table in tables for line in table.read_text().splitlines()[1:]}
    (copy,) = [command for command in COMMANDS if command.startswith("cp data/raw/demo")]
    (tmp_path / "data/raw/demo").mkdir(parents=True)
    (tmp_path / "data/raw/mine").mkdir()
    for name in names:
        (tmp_path / f"data/raw/demo/{name}.mcap").touch()
    subprocess.run(["bash", "-c", copy], cwd=tmp_path, check=True)
    logs = sorted(path.stem for path in (tmp_path / "data/raw/mine").glob("*.mcap"))
    kinds = {name: name.split("_")[0] for name in logs}
    last = {kind: name for name, kind in kinds.items()}
    rows = [f"  - {{file: {n}.mcap, experiment: x, split: {DECIDING[last[kinds[n]] == n]}}}" for n in logs]
    (tmp_path / "data/raw/mine/session.yaml").write_text("trials:\n" + "\n".join(rows) + "\n")
    for command in COMMANDS:
        if command.startswith("sed -i") and "session.yaml" in command:
            subprocess.run(shlex.split(command), cwd=tmp_path, check=True)
    splits_of: dict[str, set[str]] = {}
    for trial in yaml.safe_load((tmp_path / "data/raw/mine/session.yaml").read_text())["trials"]:
        splits_of.setdefault(kinds[trial["file"].removesuffix(".mcap")], set()).add(trial["split"])
    assert set(splits_of) == {"tilt", "pull", "release", "curl", "motion"}
    assert all(splits == {*DECIDING, TEST} for splits in splits_of.values()), splits_of
