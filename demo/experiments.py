"""The experiments of the paper's table, as a plan: which trials there are, and what each is kept for."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

from pydantic import Field

from trunkline.trials.recording import Planned
from trunkline.trials.splits import IDENTIFY, VALIDATE

Tilt = Annotated[float, Field(ge=0, le=180)]
Azimuth = Annotated[float, Field(ge=0, lt=360)]
Group = Annotated[list[Annotated[int, Field(ge=1, le=12)]], Field(min_length=1)]
Level = Annotated[float, Field(gt=0, le=1000)]
Duration = Annotated[float, Field(gt=0, le=600)]
Coordinate = Annotated[float, Field(ge=-100, le=100)]


@dataclass
class ForTest:
    """Tilts, directions, levels and tendons of the test split, as in `Experiments`: none is in another split."""

    tilts: Annotated[list[Tilt], Field(min_length=1)]
    release_directions: Annotated[list[Azimuth], Field(min_length=1)]
    curl_levels: Annotated[list[Level], Field(min_length=1)]
    curl_tendons: Annotated[list[Group], Field(min_length=1)]


@dataclass
class Experiments:
    """The list of trials. Angles in degrees, levels in mm, times in s, forces in N.

    mount_position: m, of the arm's mount in the world.
    tilts: each recorded `tilt_repeats` times at rest for `rest_duration`, after a hand has steadied the arm for
    `settle` (all damping `steady_factor` times as large); the mount is set to within `tilt_scatter_deg` about
    both horizontal axes.
    release_directions: azimuths (deg from +x) to which the arm is bent, with a pull of `release_pull` N times one
    of `release_factors` in turn, growing over `bend_duration`; recorded `bend_settle` later for `hold_duration`
    of hold and `release_duration` after letting go.
    curl_levels: pulled by each of `curl_tendons` (lists of tendons pulled together); a cycle is `curl_rest`, a
    ramp of `curl_ramp`, a hold of `curl_hold`, the ramp back and a rest of `curl_hold`.
    validate_every: about one in so many trials of each experiment is in the validate split, the others in identify.
    test: what is done anew for the test split; everything else is as above.
    """

    mount_position: tuple[Coordinate, Coordinate, Coordinate]
    tilts: Annotated[list[Tilt], Field(min_length=1)]
    tilt_repeats: Annotated[int, Field(ge=1, le=100)]
    tilt_scatter_deg: Annotated[float, Field(ge=0, le=90)]
    settle: Duration
    steady_factor: Annotated[float, Field(ge=1, le=1000)]
    rest_duration: Duration
    release_directions: Annotated[list[Azimuth], Field(min_length=1)]
    release_pull: Annotated[float, Field(gt=0, le=1e5)]
    release_factors: Annotated[list[Annotated[float, Field(gt=0, le=100)]], Field(min_length=1)]
    bend_duration: Duration
    bend_settle: Duration
    hold_duration: Duration
    release_duration: Duration
    curl_levels: Annotated[list[Level], Field(min_length=1)]
    curl_tendons: Annotated[list[Group], Field(min_length=1)]
    curl_rest: Duration
    curl_ramp: Duration
    curl_hold: Duration
    validate_every: Annotated[int, Field(ge=2, le=1000)]
    test: ForTest

    def tested(self) -> "Experiments":
        """What is done for the test split."""
        return replace(self, tilt_repeats=1, **vars(self.test))


def tilt_trials(experiments: Experiments) -> list[Planned]:
    """All tilts, once a repeat; every repeat leaves out another tilt, so that each is validated in turn."""
    return [
        Planned(
            name=f"tilt_{tilt:03.0f}_{chr(ord('a') + repeat)}",
            experiment="static_tilt",
            split=_split(repeat, index, experiments),
            level=tilt,
        )
        for repeat in range(experiments.tilt_repeats)
        for index, tilt in enumerate(experiments.tilts)
    ]


def release_trials(experiments: Experiments) -> list[Planned]:
    """One a direction."""
    last = experiments.validate_every - 1
    return [
        Planned(
            name=f"release_{azimuth:03.0f}",
            experiment="release",
            split=_split(last, index, experiments),
            level=None,
        )
        for index, azimuth in enumerate(experiments.release_directions)
    ]


def curl_trials(experiments: Experiments) -> list[Planned]:
    """All levels, once a group of tendons; every group leaves out other levels, so that all are identified from."""
    return [
        Planned(
            name=f"curl_{'_'.join(map(str, group))}_{level:03.0f}",
            experiment="curl",
            split=_split(row, index, experiments),
            level=level,
        )
        for row, group in enumerate(experiments.curl_tendons)
        for index, level in enumerate(experiments.curl_levels)
    ]


# name of the experiment to (the setting that plans it, the trials that it plans)
PLANS: dict[str, tuple[str, Callable[[Experiments], list[Planned]]]] = {
    "static_tilt": ("tilts", tilt_trials),
    "release": ("release_directions", release_trials),
    "curl": ("curl_levels", curl_trials),
}


def _split(row: int, index: int, experiments: Experiments) -> str:
    """One in every `validate_every` trials of a row is for validation, in each row one further along."""
    every = experiments.validate_every
    return VALIDATE if index % every == row % every else IDENTIFY
