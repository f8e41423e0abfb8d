"""The effects that are on are those that the study of them chose, or docs/results/effects.md says why not."""

import csv
import re

import pytest
from omegaconf import OmegaConf

from stages.build_mjcf import Config as CadConfig
from studies.effects import EFFECTS, ModelEffect
from tests.support.workbench import ROOT
from trunkline.pipeline.config import load_config

PAGE = (ROOT / "docs/results/effects.md").read_text()
STAGES = ("identify_stiffness", "identify_damping", "identify_control")


def chosen() -> dict[str, bool]:
    """By an effect's title, whether it passed the study's rule."""
    with (ROOT / "docs/results/effects.csv").open() as file:
        return {EFFECTS[row["effect"]].title: row["kept"] == "yes" for row in csv.DictReader(file)}


def table() -> dict[str, tuple[bool, str]]:
    """By an effect's title, whether the page says that it is on, and the reason that it gives."""
    part = PAGE.split("## What is on")[1]
    rows = re.findall(r"^\| ([^|]+) \| (yes|no) \|(.*)\|$", part, re.MULTILINE)
    return {title: (on == "yes", reason.strip()) for title, on, reason in rows}


def departures(chosen: dict[str, bool], on: dict[str, bool], table: dict[str, tuple[bool, str]]) -> list[str]:
    """What is wrong with a page's `table`, of what the study chose and what is on."""
    problems = [f"{title}: not in the table" for title in chosen if title not in table]
    problems += [f"{title}: no such effect" for title in table if title not in chosen]
    for title in (title for title in chosen if title in table):
        says, reason = table[title]
        if says != on[title]:
            problems.append(f"{title}: the table says {says}, the settings say {on[title]}")
        if (on[title] != chosen[title]) != bool(reason):
            problems.append(f"{title}: a reason where there is none to give, or none where there is")
    return problems


def is_in(effect: ModelEffect, cad: CadConfig, identified: set[str]) -> bool:
    """Whether the CAD model has its parts and the stages identify its parameters."""
    parts = [cad.joints.round] if effect.joints.round else []
    parts += [bool(cad.joints.sliders)] if effect.joints.sliders else []
    parts += [bool(cad.joints.branches)] if effect.joints.branches else []
    parts += [cad.holes.stretches > 0] if effect.holes.stretches else []
    parts += [cad.actuation.dead_time > 0] if effect.dead_time else []
    parts += [cad.actuation.time_constant > 0] if effect.lag else []
    return all(parts) and set(effect.parameters) <= identified


@pytest.fixture(scope="module")
def on():
    params = OmegaConf.load(ROOT / "params.yaml")
    identified = {name for stage in STAGES for name in params[stage].parameters}
    cad = load_config(CadConfig, "build_mjcf", ROOT)
    return {effect.title: is_in(effect, cad, identified) for effect in EFFECTS.values()}


def test_every_departure_from_the_study_s_rule_has_its_reason(on):
    assert departures(chosen(), on, table()) == []
    assert len(chosen()) == len(EFFECTS)


@pytest.mark.parametrize(
    ("passed", "is_on", "says", "reason", "problem"),
    [
        (True, True, True, "", ""),
        (True, False, False, "it costs curls", ""),
        (True, False, False, "", "a reason"),
        (False, True, True, "", "a reason"),
        (True, True, True, "it is good", "a reason"),
        (True, False, True, "", "the settings say False"),
    ],
)
def test_a_departure_without_a_reason_is_a_problem(passed, is_on, says, reason, problem):
    problems = departures({"lag": passed}, {"lag": is_on}, {"lag": (says, reason)})
    if problem:
        assert any(problem in line for line in problems)
    else:
        assert problems == []


def test_an_effect_that_the_page_leaves_out_is_a_problem():
    assert departures({"lag": True}, {"lag": True}, {}) == ["lag: not in the table"]
    assert departures({}, {}, {"lag": (True, "")}) == ["lag: no such effect"]


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_whose_parameter_is_not_identified_is_off(name):
    effect, cad = EFFECTS[name], load_config(CadConfig, "build_mjcf", ROOT)
    if effect.parameters:
        assert not is_in(effect, cad, set(list(effect.parameters)[1:]))
    else:
        cad.joints.round = False
        assert not is_in(effect, cad, set())
