"""The experiments, done with a plant: tilts, releases and curls of the paper's table, slow pulls and motions.

Everything happens in the base frame with gravity turned, then is placed in the world (z-up).
"""

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from demo.experiments import Experiments, curl_trials, motion_trials, pull_trials, release_trials, tilt_trials
from demo.plants.bench import COMMAND_RATE, LOOSE, SAMPLE_RATE, Bench, Plant, PlantMotion
from demo.truth import Truth
from trunkline.frames import STANDARD_GRAVITY, wxyz_from_rotation
from trunkline.model.arm.mjcf import unit_name
from trunkline.recordings.trials.recording import PlannedTrial
from trunkline.recordings.trials.splits import TEST


def record(
    plant: Plant,
    experiments: Experiments,
    tracked: list[int],
    rng: np.random.Generator,
    test_rng: np.random.Generator,
) -> list[Truth]:
    """Do all experiments. Those beyond the paper's table come last, and of each part those of the test split.

    Args:
        tracked: indices of the tracked units.
        rng, test_rng: draw how well the lab sets the tilts, and the phases of motions; the latter for the test split,
            whose trials therefore change no other.
    """
    lab = Laboratory(plant, experiments.mount_position, tracked)

    def both(done) -> list[Truth]:
        identified, tested = done(experiments, rng), done(experiments.tested(), test_rng)
        return [*identified, *(replace(truth, split=TEST) for truth in tested)]

    def table(planned: Experiments, draws: np.random.Generator) -> list[Truth]:
        return [*lab.tilts(planned, draws), *lab.releases(planned), *lab.curls(planned)]

    def beyond(planned: Experiments, draws: np.random.Generator) -> list[Truth]:
        plans = [(planned.with_lists(loaded), loaded.load) for loaded in planned.loads]
        loaded = [(*lab.tilts(plan, draws, load), *lab.releases(plan, load)) for plan, load in plans]
        return [*chain(*loaded), *lab.pulls(planned), *lab.motions(planned, draws)]

    return both(table) + both(beyond)


@dataclass
class Laboratory:
    """A plant and what its `tracked` units (indices) are seen to do. mount_position: m, in the world."""

    plant: Plant
    mount_position: tuple[float, float, float]
    tracked: list[int]

    def tilts(self, experiments: Experiments, rng: np.random.Generator, load: float = 0.0) -> list[Truth]:
        """The arm at rest, its cables loose, under a tilted mount. load: kg at the tip."""
        trials = tilt_trials(experiments, load)
        mounts = [_mount(trial.level, experiments.tilt_scatter_deg, rng) for trial in trials]
        loose = self._loose(trials, experiments.settle + experiments.rest_duration)
        bench = self._bench(
            trials, mounts, loose, steady=experiments.settle, steady_factor=experiments.steady_factor,
            since=experiments.settle,
        )  # fmt: skip
        return self._placed("tilts", trials, mounts, bench)

    def releases(self, experiments: Experiments, load: float = 0.0) -> list[Truth]:
        """The arm bent by hand and let go, its cables loose. load: kg at the tip."""
        trials = release_trials(experiments, load)
        bend, hold = experiments.bend_duration, experiments.bend_settle + experiments.hold_duration
        loose = self._loose(trials, bend + hold + experiments.release_duration)
        time = np.arange(loose.shape[1]) * (1 / COMMAND_RATE)
        strength = np.where(time < bend + hold, np.minimum(time / bend, 1.0), 0.0)
        pulls = np.zeros_like(loose)
        for index, azimuth in enumerate(experiments.release_directions):
            factor = experiments.release_factors[index % len(experiments.release_factors)]
            pull = experiments.release_pull * factor * _shares(azimuth, self.plant.tendons)
            pulls[index] = strength[:, None] * pull
        upright = [Rotation.identity()] * len(trials)
        bench = self._bench(trials, upright, loose, pulls=pulls, since=bend + experiments.bend_settle)
        return self._placed("releases", trials, upright, bench, begin=experiments.hold_duration)

    def curls(self, experiments: Experiments) -> list[Truth]:
        """The arm curled and uncurled by its motors; the tendons that do not pull are loose."""
        trials = curl_trials(experiments)
        groups = [group for group in experiments.curl_tendons for _ in experiments.curl_levels]
        rest, ramp, hold = experiments.curl_rest, experiments.curl_ramp, experiments.curl_hold
        ends = np.cumsum([0, rest, ramp, hold, ramp])
        commands = self._loose(trials, ends[-1] + hold)
        profile = np.interp(np.arange(commands.shape[1]) * (1 / COMMAND_RATE), ends, [0, 0, 1, 1, 0])
        for index, (trial, group) in enumerate(zip(trials, groups, strict=True)):
            for tendon in group:
                commands[index, :, tendon - 1] = profile * trial.level / 1000
        return self._driven("curls", trials, commands, begin=rest)

    def pulls(self, experiments: Experiments) -> list[Truth]:
        """The arm at rest where its motors have slowly brought it, some straight, some from beyond."""
        trials, settle = pull_trials(experiments), experiments.pull_settle
        ends = np.cumsum([0, experiments.pull_ramp, experiments.pull_turn, experiments.pull_back])
        commands = self._loose(trials, ends[-1] + settle + experiments.rest_duration)
        time = np.arange(commands.shape[1]) / COMMAND_RATE
        for index, pull in enumerate(experiments.pulls):
            beyond = experiments.pull_beyond if pull.from_beyond else 1.0
            profile = np.interp(time, ends, [0, beyond, beyond, 1])
            for tendon, level in enumerate(pull.levels):
                if level is not None:
                    commands[index, :, tendon] = profile * level / 1000
        return self._driven("pulls", trials, commands, since=ends[-1] + settle)

    def motions(self, experiments: Experiments, rng: np.random.Generator) -> list[Truth]:
        """The arm moved about by sines of several frequencies to all sides, from rest."""
        trials, rest = motion_trials(experiments), experiments.motion_rest
        commands = self._loose(trials, rest + experiments.motion_duration)
        time = np.arange(commands.shape[1]) / COMMAND_RATE - rest
        fade = np.clip(time / experiments.motion_fade, 0, 1)
        azimuths = 2 * np.pi * np.arange(self.plant.tendons) / self.plant.tendons
        for index, motion in enumerate(experiments.motions):
            phases = rng.uniform(0, 2 * np.pi, (len(motion.frequencies), 2))
            turns = 2 * np.pi * np.outer(time, motion.frequencies)
            sides = fade[:, None] * np.sin(turns[:, :, None] + phases).sum(axis=1)
            sides *= motion.amplitude / np.abs(sides).max(axis=0)
            commands[index] = (sides @ np.stack([np.cos(azimuths), np.sin(azimuths)]) + motion.offset) / 1000
        return self._driven("motions", trials, commands, begin=rest)

    def _loose(self, trials: list[PlannedTrial], duration: float) -> np.ndarray:
        """Commands (n, T, K) that leave all cables loose for `duration` s."""
        return np.full((len(trials), round(duration * COMMAND_RATE), self.plant.tendons), -LOOSE)

    def _bench(self, trials, mounts: list[Rotation], commands: np.ndarray, pulls=None, **more) -> Bench:
        down = [0, 0, -STANDARD_GRAVITY]
        return Bench(
            gravity=np.array([mount.inv().apply(down) for mount in mounts]).reshape(-1, 3),
            commands=commands,
            pulls=np.zeros_like(commands) if pulls is None else pulls,
            loads=np.array([trial.load for trial in trials]),
            **more,
        )

    def _driven(self, label: str, trials, commands: np.ndarray, begin: float = 0.0, since: float = 0.0) -> list[Truth]:
        """Trials under an upright mount in which motors and their commands are recorded."""
        upright = [Rotation.identity()] * len(trials)
        bench = self._bench(trials, upright, commands, since=since)
        return self._placed(label, trials, upright, bench, begin, with_motors=True)

    def _placed(self, label: str, trials, mounts, bench: Bench, begin: float = 0.0, with_motors=False) -> list[Truth]:
        """The plant's trials, placed in the world. begin: s, from `bench.since`."""
        if not trials:
            return []
        motion = self.plant.run(label, bench, self.tracked)
        truths = []
        for index, (trial, mount) in enumerate(zip(trials, mounts, strict=True)):
            truth = self._truth(trial, mount, motion, index, begin)
            if with_motors:
                truth.tendons = tuple(f"tendon_{k + 1}" for k in range(self.plant.tendons))
                samples = bench.skipped + len(truth.time)
                truth.command_time = (np.arange(samples) - bench.skipped) / SAMPLE_RATE  # sent before the first frame
                truth.commands = bench.commands[index, : samples * bench.stride : bench.stride]
                truth.tendon_positions = motion.wound[index]
            truths.append(truth)
        return truths

    def _truth(self, trial: PlannedTrial, mount: Rotation, motion: PlantMotion, index: int, begin: float) -> Truth:
        """The trial of this index, under a mount turned by `mount` (world ← base)."""
        positions, rotations = motion.positions[index], motion.rotations[index]
        local = Rotation.from_matrix(rotations.reshape(-1, 3, 3))
        origin = np.array(self.mount_position)
        return Truth(
            **vars(trial),
            time=np.arange(len(positions)) / SAMPLE_RATE,
            base_position=origin,
            base_quaternion=wxyz_from_rotation(mount),
            markers=tuple(unit_name(unit) for unit in self.tracked),
            positions=origin + mount.apply(positions.reshape(-1, 3)).reshape(positions.shape),
            quaternions=wxyz_from_rotation(mount * local).reshape(*positions.shape[:2], 4),
            tendons=(),
            begin=begin,
            command_time=np.empty(0),
            commands=np.empty((0, 0)),
            tendon_positions=np.empty((len(positions), 0)),
        )


def _mount(tilt_deg: float, scatter_deg: float, rng: np.random.Generator) -> Rotation:
    """Rotation world ← base of a mount tilted about +y, with the scatter of the hand that set it."""
    pitch, roll = rng.normal(0, scatter_deg, 2)
    return Rotation.from_euler("YX", [tilt_deg + pitch, roll], degrees=True)


def _shares(azimuth_deg: float, tendons: int) -> np.ndarray:
    """Non-negative pulls whose sum of moments has length 1 and points to the azimuth. Shape (tendons,)."""
    angles = 2 * np.pi * np.arange(tendons) / tendons
    azimuth = np.radians(azimuth_deg)
    return nnls(np.stack([np.cos(angles), np.sin(angles)]), np.array([np.cos(azimuth), np.sin(azimuth)]))[0]
