"""The lab's settings, and a plant that only notes what it is asked."""

import numpy as np
import pytest

from demo.plants.bench import PlantMotion
from demo.rig import ROOT, Config
from trunkline.pipeline.config import load_config


@pytest.fixture(scope="module")
def lab():
    return load_config(Config, "record", ROOT)


class Watched:
    """The last unit's centre goes along `way`, m (3,), in every run; with `rests` only of those arms that do not rest
    yet, each from the run on that is named for it."""

    tendons = 3

    def __init__(self, way=(0.0, 0.0, 0.0), rests=None):
        self.way, self.rests, self.asked = np.array(way), rests, []

    def run(self, label, bench, tracked):
        count, moving = len(bench.commands), np.ones(len(bench.commands), bool)
        if self.rests is not None:
            moving = np.array(self.rests) > len(self.asked)
            self.rests = np.array(self.rests)[moving]
        self.asked.append((bench, tracked))
        samples = bench.commands.shape[1] // bench.stride - bench.skipped
        ways = np.linspace(0, 1, samples)[None, :, None] * moving[:, None, None] * self.way
        turns = np.broadcast_to(np.eye(3), (count, samples, 1, 3, 3))
        return PlantMotion(ways[:, :, None], turns, np.zeros((count, samples, 3)))

    def answers(self):
        return {}
