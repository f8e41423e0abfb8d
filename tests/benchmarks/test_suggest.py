"""The benchmark of suggestions: the lab records what it is asked for, and the table counts who got where."""

import numpy as np
import pytest

from benchmarks.suggest import reached_lines, table_lines
from benchmarks.suggest_lab import HOLD, Lab, fixed_list, held_out, pull, release, started
from demo.plants.choice import plant_of
from demo.rig import ROOT, Config
from tests.support.small_arm import small_spec
from trunkline.identification.simulate.experiment import SLACK
from trunkline.pipeline.config import load_config


def test_nobody_may_choose_what_twins_are_held_against():
    names = [one.name for one in (*started(), *fixed_list(), *held_out())]
    assert len(names) == len(set(names))
    assert [one.level for one in started() + fixed_list() if one.kind == "static_tilt"] == [0, 30, 60, 90]


def test_the_lab_records_what_it_is_asked_for():
    settings = load_config(Config, "record", ROOT)
    lab = Lab(plant_of(settings), [0, 11, 23], 0, small_spec(4).compile())
    held, let_go = lab.trials([pull(30, None, None), release(90)])
    assert held.positions.shape == (1, 3, 3)
    assert held.commands[0, 0] == pytest.approx(0.03)
    assert held.commands[0, 1] <= -SLACK
    assert held.positions[0, -1, 0] > 0.05, "tendon 1 lies over +x"
    begun = int(HOLD * 120) - 2
    assert np.ptp(let_go.positions[:begun], axis=0).max() < 0.01, "held"
    assert let_go.positions[begun, -1, 1] > 0, "towards +y"
    assert np.ptp(let_go.positions[begun:, -1], axis=0).max() > 0.1, "let go"
    assert lab.trials([pull(30, None, None)])[0] is held, "once"


def test_the_table_counts_who_is_as_near_as_the_list():
    rows = [
        {f"the paper's list {n} error": 10 - n for n in range(5)}
        | {f"quick {n} error": 10 - 3 * n for n in range(3)} | {f"slow {n} error": 9.5 - n for n in range(3)}
        | {f"{m} {n} width": 0.5 for m in ("the paper's list", "quick", "slow") for n in range(5)},
    ]  # fmt: skip
    methods = ["the paper's list", "quick", "slow"]
    quick, slow = reached_lines(rows, methods[1:], 4)
    assert quick.startswith("quick: as near as the whole list of 4 with at most 2 trials in 1 of 1 seeds, ")
    assert quick.endswith("the median of them with 2")
    assert slow.endswith("in 0 of 1 seeds")
    lines = table_lines(rows, methods, 4)
    assert lines[3].startswith("| 1 | 9.0 ")
    assert lines[-1].endswith("|  |  |"), "the list goes on alone"
