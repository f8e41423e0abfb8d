"""The experiments as a plan: which trials there are, and what each is kept for."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated

from pydantic import Field

from trunkline.recordings.trials.recording import PlannedTrial
from trunkline.recordings.trials.splits import IDENTIFY, VALIDATE

Tilt = Annotated[float, Field(ge=0, le=180)]
Azimuth = Annotated[float, Field(ge=0, lt=360)]
Group = Annotated[list[Annotated[int, Field(ge=1, le=12)]], Field(min_length=1)]
Level = Annotated[float, Field(gt=0, le=1000)]
Duration = Annotated[float, Field(gt=0, le=600)]
Coordinate = Annotated[float, Field(ge=-100, le=100)]
Pulled = Annotated[float, Field(ge=-1000, le=1000)]
Frequency = Annotated[float, Field(gt=0, le=50)]


@dataclass
class Loaded:
    """Tilts and releases with a mass at the tip. load: kg. The lists are as in `Experiments`."""

    load: Annotated[float, Field(gt=0, le=5)]
    tilts: list[Tilt]
    release_directions: list[Azimuth]


@dataclass
class PullPlan:
    """levels: mm of pull of each tendon, null where it is loose. from_beyond: whether motors go too far at first."""

    levels: list[Pulled | None]
    from_beyond: bool


@dataclass
class MotionPlan:
    """frequencies: Hz, of sines with phases of their own to x and to y. amplitude: mm of pull, the largest of their sum
    to each of both. offset: mm of pull of all tendons, negative for slack."""

    frequencies: Annotated[list[Frequency], Field(min_length=1, max_length=20)]
    amplitude: Level
    offset: Pulled


@dataclass
class ForTest:
    """What is done for the test split, as in `Experiments`: none of it is in another split."""

    tilts: Annotated[list[Tilt], Field(min_length=1)]
    release_directions: Annotated[list[Azimuth], Field(min_length=1)]
    curl_levels: Annotated[list[Level], Field(min_length=1)]
    curl_tendons: Annotated[list[Group], Field(min_length=1)]
    loads: list[Loaded] = field(default_factory=list)
    pulls: list[PullPlan] = field(default_factory=list)
    motions: list[MotionPlan] = field(default_factory=list)


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
    loads: tilts and releases with a mass at the tip, once each.
    pulls: slow ones, recorded at rest; the motors take `pull_ramp` to their commands, or to `pull_beyond` times them,
    where they turn after `pull_turn` and go back within `pull_back`; the lab waits for `pull_settle` until the arm has
    crept to rest, and records it for `rest_duration`.
    motions: for `motion_rest` at their offsets; then sines, which grow to their full size within `motion_fade`, for
    `motion_duration`.
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
    loads: list[Loaded]
    pulls: list[PullPlan]
    pull_ramp: Duration
    pull_beyond: Annotated[float, Field(ge=1, le=10)]
    pull_turn: Duration
    pull_back: Duration
    pull_settle: Duration
    motions: list[MotionPlan]
    motion_rest: Duration
    motion_fade: Duration
    motion_duration: Duration
    validate_every: Annotated[int, Field(ge=2, le=1000)]
    test: ForTest

    def tested(self) -> "Experiments":
        """What is done for the test split."""
        return replace(self, tilt_repeats=1, **vars(self.test))

    def with_lists(self, loaded: Loaded) -> "Experiments":
        """The tilts and releases that are done with this load."""
        lists = {"tilts": loaded.tilts, "release_directions": loaded.release_directions}
        return replace(self, tilt_repeats=1, **lists)


def tilt_trials(experiments: Experiments, load: float = 0.0) -> list[PlannedTrial]:
    """All tilts, once a repeat; every repeat leaves out another tilt, so that each is validated in turn.

    Trials with a load, kg, are all to be identified from: they are few.
    """
    return [
        PlannedTrial(
            name=f"tilt_{tilt:03.0f}_{chr(ord('a') + repeat)}{_grams(load)}",
            experiment="static_tilt",
            split=IDENTIFY if load else _split(repeat, index, experiments),
            level=tilt,
            load=load,
        )
        for repeat in range(experiments.tilt_repeats)
        for index, tilt in enumerate(experiments.tilts)
    ]


def release_trials(experiments: Experiments, load: float = 0.0) -> list[PlannedTrial]:
    """One a direction. load: kg, as in `tilt_trials`."""
    last = experiments.validate_every - 1
    return [
        PlannedTrial(
            name=f"release_{azimuth:03.0f}{_grams(load)}",
            experiment="release",
            split=IDENTIFY if load else _split(last, index, experiments),
            level=None,
            load=load,
        )
        for index, azimuth in enumerate(experiments.release_directions)
    ]


def curl_trials(experiments: Experiments) -> list[PlannedTrial]:
    """All levels, once a group of tendons; every group leaves out other levels, so that all are identified from."""
    return [
        PlannedTrial(
            name=f"curl_{'_'.join(map(str, group))}_{level:03.0f}",
            experiment="curl",
            split=_split(row, index, experiments),
            level=level,
        )
        for row, group in enumerate(experiments.curl_tendons)
        for index, level in enumerate(experiments.curl_levels)
    ]


def loaded_trials(experiments: Experiments) -> list[PlannedTrial]:
    """Those with a mass at the tip."""
    plans = [(experiments.with_lists(loaded), loaded.load) for loaded in experiments.loads]
    return [trial for plan, load in plans for trial in (*tilt_trials(plan, load), *release_trials(plan, load))]


def pull_trials(experiments: Experiments) -> list[PlannedTrial]:
    """One a pull: its name tells each tendon's mm, `x` if it is loose and `m` for minus, and from where it came."""
    trials = []
    for index, pull in enumerate(experiments.pulls):
        levels = ["x" if level is None else f"{level:.0f}".replace("-", "m") for level in pull.levels]
        trials.append(
            PlannedTrial(
                name=f"pull_{'_'.join(levels)}_{'back' if pull.from_beyond else 'to'}",
                experiment="static_pull",
                split=_split(0, index, experiments),
                level=None,
            )
        )
    return trials


def motion_trials(experiments: Experiments) -> list[PlannedTrial]:
    """One a motion: its name tells its highest frequency (tenths of Hz), amplitude and offset (mm)."""
    trials = []
    for index, motion in enumerate(experiments.motions):
        numbers = (10 * max(motion.frequencies), motion.amplitude, motion.offset)
        words = "_".join(f"{number:.0f}".replace("-", "m") for number in numbers)
        split = _split(0, index, experiments)
        trials.append(PlannedTrial(name=f"motion_{words}", experiment="motion", split=split, level=None))
    return trials


# name of the experiment to (the setting that plans it, the trials that it plans)
PLANS: dict[str, tuple[str, Callable[[Experiments], list[PlannedTrial]]]] = {
    "static_tilt": ("tilts", tilt_trials),
    "release": ("release_directions", release_trials),
    "curl": ("curl_levels", curl_trials),
    "static_pull": ("pulls", pull_trials),
    "motion": ("motions", motion_trials),
}


def _grams(load: float) -> str:
    return f"_{1000 * load:.0f}g" if load else ""


def _split(row: int, index: int, experiments: Experiments) -> str:
    """One in every `validate_every` trials of a row is for validation, in each row one further along."""
    every = experiments.validate_every
    return VALIDATE if index % every == row % every else IDENTIFY
