"""Families of arms: a seed is one arm, of the ranges; a sealed seed follows the code; whatever is drawn can move."""

import numpy as np
import pytest

from demo.families import draw_arm, families, sealed_seed
from demo.plants.bench import COMMAND_RATE, LOOSE, Bench
from demo.plants.choice import plant_of
from demo.plants.stranger import OtherLaws, StrangerSettings
from demo.record import Config
from studies.families import set_up
from trunkline.pipeline.config import load_config

SEALED = sealed_seed("a code", "oval", 3)


def lab(folder, family: str, seed: int) -> Config:
    set_up(folder, family, seed)
    return load_config(Config, "record", folder / "demo")


def numbers(node) -> list:
    parts = node.values() if isinstance(node, dict) else node if isinstance(node, list) else None
    return [node] if parts is None else [number for part in parts for number in numbers(part)]


def ends(node) -> list[tuple]:
    if isinstance(node, dict) and set(node) == {"low", "high"}:
        return [(node["low"], node["high"])]
    parts = node.values() if isinstance(node, dict) else node if isinstance(node, list) else None
    return [(node, node)] if parts is None else [end for part in parts for end in ends(part)]


@pytest.mark.parametrize("family", families())
def test_a_seed_is_one_arm_within_the_family_s_ranges(family):
    drawn = [draw_arm(family, seed) for seed in (1, 2, SEALED)]
    assert drawn == [draw_arm(family, seed) for seed in (1, 2, SEALED)]
    assert drawn[0] != drawn[1]
    ranges = ends(families()[family])
    for _, plant in drawn:
        assert len(numbers(plant)) == len(ranges)
        for number, (low, high) in zip(numbers(plant), ranges, strict=True):
            assert low <= number <= high
        assert sum(number != low for number, (low, high) in zip(numbers(plant), ranges, strict=True)) > 20


def test_a_sealed_seed_is_of_the_code_the_family_and_its_number():
    of = [("a code", "oval", 3), ("another", "oval", 3), ("a code", "helix", 3), ("a code", "oval", 4)]
    assert len({sealed_seed(*parts) for parts in of}) == 4
    assert sealed_seed(*of[0]) == SEALED


def test_each_family_has_two_laws_or_more_that_the_model_has_not(tmp_path):
    names = ("stiffening", "softening", "ovality", "drag", "stribeck", "swirl_deg")
    for family in families():
        plant = lab(tmp_path / family, family, 1).plant
        assert isinstance(plant, StrangerSettings)
        laws = [name for name in names if getattr(plant.laws, name) != getattr(OtherLaws(), name)]
        assert len(laws) >= 2


@pytest.mark.parametrize("seed", [1, 2, SEALED], ids=["1", "2", "sealed"])
@pytest.mark.parametrize("family", families())
def test_whatever_is_drawn_can_be_pressed_together_and_let_go(tmp_path, family, seed):
    """The deepest command of the session: two cables drawn in by 100 mm within 0.6 s, then let out."""
    plant = plant_of(lab(tmp_path, family, seed))
    time = np.arange(round(1.4 * COMMAND_RATE)) / COMMAND_RATE
    commands = np.full((1, len(time), 3), -LOOSE)
    commands[0, :, 1:] = 0.1 * np.interp(time, [0.0, 0.6, 0.9, 1.3], [0, 1, 1, 0])[:, None]
    bench = Bench(np.array([[0, 0, -9.81]]), commands, np.zeros_like(commands), np.zeros(1))
    tip = plant.run("test", bench, [23]).positions[0, :, 0]
    assert np.linalg.norm(tip, axis=1).max() < 0.53, "no longer than it is"
    assert np.linalg.norm(tip - tip[0], axis=1).max() > 0.15
    assert np.abs(np.diff(tip, axis=0)).max() < 0.02, "no more than 10 m/s between samples"
