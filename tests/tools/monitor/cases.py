"""Scores, groups and departures made by hand, for tests of the chart and of the attribution of its alarms."""

import numpy as np

from trunkline.tools.monitor.baseline import Departure, Group
from trunkline.tools.monitor.scores import Score


def group(degrees: int = 10, spread: float = 1.0, error: float = 0.0) -> Group:
    return Group(("release",), np.zeros(1), np.full((1, 1), error), 0.0, 1.0, spread, degrees)


def departure(z: float, deviation: float = 1.0) -> Departure:
    return Departure(z * deviation, deviation, z, group())


def score(kind: str = "release", curvature=((1.0,),)) -> Score:
    curvature = np.array(curvature)
    return Score("trial", kind, None, 0.0, np.zeros(len(curvature)), curvature)
