"""Which physics an arm needs: a Markdown table, the simplest model first.

    python -m studies.effects [--only NAME ...]

Needs the filtered trials of a session. The simplest model has springs, dampers and prompt motors alone. Effects are
tried one after the other, each in the stage that identifies it: the stage is fitted with and without it, trials of the
split identify are left out in turn, and the effect is kept if it lowers the position error of the trials left out by
more than the standard error of that difference over trials. `test` is never read. Then the simplest model and the
chosen one are identified by all stages and scored on `validate`, beside a null model, the model without data and the
noise floor.

An effect's row is kept in docs/results/effects.csv as soon as it is done; stopped, the study goes on from there.
Progress goes to stderr.
"""

import argparse
import contextlib
import sys
import time
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np

from stages.build_mjcf import Config as CadConfig
from stages.build_mjcf import cad_arm
from studies.rows import Rows, digest
from studies.stage_chain import STAGES, StageChain, committed, require_demo, run_stages
from trunkline.errors import in_one_line
from trunkline.identification.diagnostics.cross_validation import errors_left_out
from trunkline.identification.evaluation.baselines import hanging_still, noise_floor
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.simulate.experiment import own_starts
from trunkline.model.arm.guide_holes import GuideHoles
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement
from trunkline.pipeline.config import load_config
from trunkline.pipeline.identify import CAD_MODEL, TRIALS, read_reported
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.recordings.trials.trial import Trial


@dataclass(frozen=True)
class ModelEffect:
    """A term of the model, the stage that identifies it, and its parameters with their ranges.

    joints, holes: what it adds to them. dead_time, lag: guesses of the motors', s.
    """

    title: str
    stage: str
    parameters: dict[str, Bounds]
    joints: Joints = field(default_factory=Joints)
    dead_time: float = 0.0
    holes: GuideHoles = field(default_factory=GuideHoles)
    lag: float = 0.0


def ranges(low: float, high: float, *names: str) -> dict[str, Bounds]:
    return {name: Bounds(low, high) for name in names}


SHARES, TIMES = (0.01, 3.0), (0.02, 20.0)  # of a spring's stiffness; s
EFFECTS: dict[str, ModelEffect] = {
    "hardening": ModelEffect("hardening", "identify_stiffness", ranges(0.02, 20.0, "hardening")),
    "round": ModelEffect("round joints", "identify_stiffness", {}, Joints(round=True)),
    "place": ModelEffect("place of the joints", "identify_stiffness", ranges(-0.2, 1.0, "joint_place")),
    "mount": ModelEffect("mount tilt", "identify_stiffness", ranges(-0.1, 0.1, "mount_tilt_x", "mount_tilt_y")),
    "bend": ModelEffect("rest shape, even", "identify_stiffness", ranges(-0.05, 0.05, "rest_bend_x", "rest_bend_y")),
    "gradient": ModelEffect(
        "rest shape, rising", "identify_stiffness", ranges(-0.05, 0.05, "rest_gradient_x", "rest_gradient_y")
    ),
    "branch": ModelEffect(
        "Maxwell branch", "identify_damping",
        ranges(*SHARES, "relaxation") | ranges(*TIMES, "relaxation_time"), Joints([MaxwellElement(0.3, 0.5)]),
    ),
    "branch_2": ModelEffect(
        "second Maxwell branch", "identify_damping",
        ranges(*SHARES, "relaxation_2") | ranges(*TIMES, "relaxation_time_2"), Joints([MaxwellElement(0.2, 2.0)]),
    ),
    "slider": ModelEffect(
        "Jenkins element", "identify_damping",
        ranges(*SHARES, "hysteresis") | ranges(5e-4, 0.3, "yield_bend"), Joints(sliders=[JenkinsElement(0.2, 0.02)]),
    ),
    "friction": ModelEffect(
        "tendon friction", "identify_damping",
        ranges(0.005, 3.0, "tendon_friction") | ranges(0.003, 0.3, "friction_time"),
    ),
    "holes": ModelEffect(
        "capstan friction", "identify_control", ranges(0.005, 2.0, "capstan_friction"), holes=GuideHoles(0.2, 8)
    ),
    "dead_time": ModelEffect("dead time", "identify_control", ranges(0.001, 0.2, "dead_time"), dead_time=0.02),
    "lag": ModelEffect("lag of the motors", "identify_control", ranges(0.002, 0.3, "time_constant"), lag=0.02),
}  # fmt: skip
FOLDS = 3  # groups of trials that are left out in turn
NO_LAG = 1e-6  # s; MuJoCo's filter wants some
OPTIONAL = {name for effect in EFFECTS.values() for name in effect.parameters}


def cad_model(effects: list[ModelEffect]) -> mujoco.MjModel:
    """The CAD model with what the effects add to it."""
    config = load_config(CadConfig, "build_mjcf")
    config.joints = Joints(
        [branch for effect in effects for branch in effect.joints.branches],
        [slider for effect in effects for slider in effect.joints.sliders],
        any(effect.joints.round for effect in effects),
    )
    config.holes = next((effect.holes for effect in effects if effect.holes.stretches), GuideHoles())
    config.actuation.dead_time = max((effect.dead_time for effect in effects), default=0.0)
    config.actuation.time_constant = max((effect.lag for effect in effects), default=0.0) or NO_LAG
    model = cad_arm(config).spec.compile()
    if not any("tendon_friction" in effect.parameters for effect in effects):
        model.tendon_frictionloss[:] = 0
    return model


def settings_of(stage: str, effects: list[ModelEffect]) -> IdentificationSettings:
    """The committed settings of a stage, of the optional parameters those of `effects` alone; no factors of joints."""
    config = committed(stage)
    parameters = {name: span for name, span in config.parameters.items() if name not in OPTIONAL}
    for effect in effects:
        parameters |= effect.parameters if effect.stage == stage else {}
    return replace(config, parameters=parameters, per_joint=[])


def left_out(link: StageChain, stage: str) -> np.ndarray:
    """Position error of every trial to identify from, not having been seen by the last stage's fit, mm."""
    kinds = settings_of(stage, []).experiments
    fitted = [e for e in link.experiments if e.kind in kinds]
    with contextlib.redirect_stdout(sys.stderr):
        table = errors_left_out(stage, link.result, fitted, link.fit, FOLDS)
    return table[table["model"] == "identified"]["e_position_mm"].to_numpy()


def chain(effects: list[ModelEffect], last: str, chains: dict[str, StageChain]) -> StageChain:
    """The stages up to `last`, with `effects`."""
    model = cad_model(effects)
    key = f"{model.nq} {model.ntendon} {model.nhistory} {model.actuator_dynprm[:1, 0]}\n"
    return run_stages((key, model), lambda stage: settings_of(stage, effects), chains, last=last)


def validated(title: str, link: StageChain, trials: list[Trial], cad: mujoco.MjModel) -> list[str]:
    """Rows of the last table: errors on `validate` by kind, beside those of what knows less, and the noise floor.

    Args:
        trials: those of the link's experiments, in the same order. cad: the model without data.
    """
    pairs = [(trial, e) for trial, e in zip(trials, link.experiments, strict=True) if e.split == VALIDATE]
    seen, unseen = [trial for trial, _ in pairs], [e for _, e in pairs]
    replayed, own = replay(link.model, unseen, link.fit.markers), own_starts(unseen, seen, link.model, cad)
    beside = (
        Prediction(hanging_still(unseen, replayed, link.experiments), unseen),
        Prediction(replay(cad, own, link.fit.markers), own),
        noise_floor(seen, unseen, link.model, replayed),
    )
    others = [prediction.scores()[VALIDATE]["by_experiment"] for prediction in beside]
    rows = []
    for kind, row in Prediction(replayed, unseen).scores()[VALIDATE]["by_experiment"].items():
        errors = [f"{row[f'{name}_mm']:.2f}" for name in ("e_internal", "e_position", "e_tip")]
        errors += [f"{row['e_tip_pct']:.2f}", *(f"{other[kind]['e_tip_mm']:.2f}" for other in others)]
        rows.append(f"| {title} | {kind} | {' | '.join(errors)} |")
    return rows


def tried(names: list[str], table: Rows, chains: dict[str, StageChain]) -> list[ModelEffect]:
    """The effects that are kept of those to try. Rows that the table lacks are added."""
    done, kept, last = table.read(), [], ("", np.array([]))
    for name in names:
        effect = EFFECTS[name]
        if name not in done:
            begun, stage = time.perf_counter(), effect.stage
            if last[0] != stage:  # else what stood after the last effect of the stage is what stands before this one
                last = stage, left_out(chain(kept, stage, chains), stage)
            errors = left_out(chain([*kept, effect], stage, chains), stage)
            gain = last[1] - errors
            standard_error = gain.std(ddof=1) / np.sqrt(len(gain))
            pays = bool(gain.mean() > standard_error)
            table.add(
                name, without=last[1].mean(), with_it=errors.mean(), gain=gain.mean(), standard_error=standard_error,
                kept="yes" if pays else "no", seconds=time.perf_counter() - begun,
            )  # fmt: skip
            done = table.read()
            if pays:
                last = stage, errors
        kept += [effect] if done[name]["kept"] == "yes" else []
    return kept


def effect_table(rows: dict[str, dict]) -> str:
    lines = ["| effect | position error left out (mm): without | with | lower by | kept | seconds |"]
    lines.append("|---|---:|---:|---:|---|---:|")
    for name, row in rows.items():
        means = f"{row['without']:.3f} | {row['with_it']:.3f} | {row['gain']:.3f} ± {row['standard_error']:.3f}"
        lines.append(f"| {EFFECTS[name].title} | {means} | {row['kept']} | {row['seconds']:.0f} |")
    return "\n".join(lines)


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.effects", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=EFFECTS, default=list(EFFECTS), help="effects to try")
    arguments = parser.parse_args()
    require_demo(CAD_MODEL)
    chains: dict[str, StageChain] = {}
    every = [settings_of(stage, list(EFFECTS.values())) for stage in STAGES]
    made_of = [load_config(CadConfig, "build_mjcf"), every, list(EFFECTS.values()), FOLDS, arguments.only]
    is_whole = arguments.only == list(EFFECTS)
    table = Rows("effects" if is_whole else "effects_part", digest(made_of, TRIALS), "effect")
    with table.recorded(is_whole):
        kept = tried(arguments.only, table, chains)
        print(effect_table(table.read()))
        words = "the tip's also in % of length; null: the mean shape at rest; CAD: the model without data"
        print(f"\nErrors on `validate`, {words}.\n")
        errors = "E_internal (mm) | position (mm) | tip (mm) | tip (%)"
        print(f"| model | experiment | {errors} | null, tip (mm) | CAD, tip (mm) | noise floor, tip (mm) |")
        print("|---|---|---:|---:|---:|---:|---:|---:|---:|", flush=True)
        for title, effects in (("simplest", []), ("chosen", kept)):
            for stage in STAGES:
                link, trials = chain(effects, stage, chains), read_reported(settings_of(stage, effects))
                print("\n".join(validated(f"{title}, {stage}", link, trials, cad_model(effects))), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
