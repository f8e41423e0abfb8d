"""A trial set up for simulation: where it starts, what drives it, what it is compared with."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.identification.parameters.per_session import model_in
from trunkline.identification.parameters.spool_scale import wound
from trunkline.identification.simulate.checks import check_names
from trunkline.identification.simulate.loss import LossWeights
from trunkline.identification.simulate.pose_fit import PoseFit, start_frames, start_of
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.shortening import shortened
from trunkline.recordings.trials.experiments import is_static, is_stepwise
from trunkline.recordings.trials.trial import Trial

SLACK = 0.3  # m of tendon paid out where nothing pulls, more than any bend takes up
GEOMETRY = ("jnt_pos", "jnt_axis", "body_pos", "body_quat", "site_pos")
SAME_PLACE = 1e-5  # m, and of a quaternion; what MJCF rounds away is less


@dataclass
class Experiment:
    """One simulation per candidate, of T frames at `frame_step` seconds. A static trial has T = 1, or T shapes at rest
    with a `frame_step` of 0.

    Attributes:
        name, kind, split: as in the trial; kind is its experiment.
        gravity: m/s², base frame. Shape (3,).
        load: kg at the tip, beside the model's own.
        start: angles of the arm's hinges from which it starts. Shape (n,).
        velocity: with which it starts, rad/s; 0 unless the trial's arm moves then. Shape (n,).
        lead: s from the start to the first frame.
        controls: commanded tendon lengths, m, or tensions, N, held from one frame to the next: row 0 from the start to
            the first frame, row t from frame t - 1 to frame t. Shape (T, nu).
        positions: measured markers, m, base frame. Shape (T, S, 3).
        measured: where they count. Shape (T, S).
        fit: how well the start matches the measurement.
        repaired: whether `ingest` changed anything in the trial.
        session: to which the trial belongs.
        approach: as in the trial: 1 if motors drew the arm to where it rests, -1 from beyond, 0 if that is unknown.
    """

    name: str
    kind: str
    split: str
    gravity: np.ndarray
    start: np.ndarray
    velocity: np.ndarray
    lead: float
    controls: np.ndarray
    positions: np.ndarray
    measured: np.ndarray
    frame_step: float
    fit: PoseFit
    repaired: bool = False
    load: float = 0.0
    session: str = ""
    approach: int = 0

    @property
    def frames(self) -> int:
        return len(self.positions)

    def slack(self, model: mujoco.MjModel) -> bool:
        """Whether all cables of `model` are let out throughout, as where the trial commands nothing."""
        arm = ArmModel(model)
        if arm.commands == "force":
            return bool((self.controls <= 0).all())
        return bool((self.controls > arm.controls(np.zeros(model.nu)) + 0.9 * SLACK).all())

    def shortened(self, frames: int) -> "Experiment":
        """Its first `frames` frames."""
        return replace(
            self, controls=self.controls[:frames], positions=self.positions[:frames], measured=self.measured[:frames]
        )


def prepare(trial: Trial, model: mujoco.MjModel, frames: int, command_delay: float = 0.0) -> Experiment:
    """Set up one trial: from its detected start, for at most `frames` frames.

    Args:
        command_delay: s from a logged command to the motor that acts on it.

    Raises:
        InputError: if its markers and tendons are not those of the model, or too little was measured.
    """
    check_names(trial, model)
    static, stepwise = is_static(trial.experiment), is_stepwise(trial.experiment)
    step = float(np.median(np.diff(trial.time))) if len(trial.time) > 1 and not static else 0.0
    last, start_frame = start_frames(trial)
    window = slice(None) if stepwise else slice(0, 1) if static else slice(last + 1, last + 1 + frames)
    positions, measured = trial.positions[window], trial.measured[window]
    if not measured.any():
        raise InputError(f"trial {trial.name}: found no measured frame after its start at {trial.start:.2f} s")
    fit, start, velocity = start_of(trial, arm_in(trial, model, start_frame), start_frame)
    controls = commanded_controls(trial, model)
    if command_delay and model.nu:
        controls = np.stack(
            [np.interp(trial.time - command_delay, trial.time, column) for column in controls.T], axis=1
        )
    return Experiment(
        name=trial.name,
        kind=trial.experiment,
        split=trial.split,
        gravity=trial.gravity,
        start=start,
        velocity=velocity,
        lead=0.0 if static else _lead(trial, last),
        controls=controls[window] if static else 0.5 * (controls[:-1] + controls[1:])[last : last + len(positions)],
        positions=positions,
        measured=measured,
        frame_step=step,
        fit=fit,
        repaired=trial.repairs > 0,
        load=trial.load,
        session=trial.session,
        approach=trial.approach,
    )


def weights_for(experiment: Experiment, weights: LossWeights) -> LossWeights:
    """Those of the loss that are for a trial: shapes at rest that follow each other have no velocity."""
    return replace(weights, weight_velocity=0.0) if is_stepwise(experiment.kind) else weights


def own_starts(
    experiments: list[Experiment], trials: list[Trial], fitted: mujoco.MjModel, model: mujoco.MjModel
) -> list[Experiment]:
    """Experiments that were prepared with the model `fitted`, from where `model` has its hinges in the measured poses.

    They stay as they are if both models have the same geometry. So do trials at rest, whose start decides nothing.

    Args:
        experiments, trials: the same ones, in the same order.
    """
    same = {
        session: all(
            np.allclose(getattr(first, name), getattr(second, name), rtol=0, atol=SAME_PLACE) for name in GEOMETRY
        )
        for session in {trial.session for trial in trials}
        for first, second in [(model_in(session, fitted), model_in(session, model))]
    }
    if all(same.values()):
        return experiments
    started = []
    for experiment, trial in zip(experiments, trials, strict=True):
        if not is_static(experiment.kind) and not same[trial.session]:
            fit, start, velocity = start_of(trial, model_in(trial.session, model), start_frames(trial)[1])
            experiment = replace(experiment, fit=fit, start=start, velocity=velocity)
        started.append(experiment)
    return started


def _lead(trial: Trial, last: int) -> float:
    """Time to simulate until the first frame: from the start, or from the frame whose velocity is known, s."""
    begin = trial.time[last] if trial.in_motion else max(trial.start, trial.time[last])
    return max(float(trial.time[last + 1] - begin), 1e-4)


def arm_in(trial: Trial, model: mujoco.MjModel, frame: int) -> mujoco.MjModel:
    """The arm as it was in the trial's session, as short as its tendons make it in a frame."""
    model = model_in(trial.session, model)
    if not len(ArmModel(model).axial_stiffness):
        return model
    sent = wound(model, commanded_controls(trial, model)[frame : frame + 1])[0]
    return shortened(model, sent[ArmModel(model).actuators])


def commanded_controls(trial: Trial, model: mujoco.MjModel) -> np.ndarray:
    """Tendon lengths that the trial commands, m, or tensions, N; slack where it commands nothing. Shape (T, nu)."""
    arm, pulls = ArmModel(model), np.empty((len(trial.time), model.nu))
    for index in range(model.nu):
        name = model.tendon(model.actuator_trnid[index, 0]).name
        idle = 0.0 if arm.commands == "force" else -SLACK
        pulls[:, index] = trial.commands[:, trial.tendons.index(name)] if name in trial.tendons else idle
    return arm.controls(pulls)
