"""The time step in Unity: whole steps a frame of the display, as few as keep each short enough.

So every frame shows the arm after as many steps as the last, and nothing judders. What the steps cost in accuracy is
measured on a curl against the step with which the arm was calibrated. `csharp/Pace.cs` chooses alike.
"""

import copy
import math
from collections.abc import Sequence

import mujoco
import numpy as np

from trunkline.unity.manifest import StepError
from trunkline.unity.roundtrip import curl, simulate

LONGEST_STEP = 0.004  # s
DISPLAY_RATES = (60.0, 72.0, 90.0, 120.0)  # Hz, of screens and headsets
TABLE_HERE = "<!-- steps: the package's README has a table here -->"
EXACT = 1e-9  # share by which a step may be longer: of rounding


def steps_per_frame(rate: float) -> int:
    """The least number of steps in a frame of a display of `rate` Hz of which none is longer than `LONGEST_STEP`."""
    return max(1, math.ceil(1 / (rate * LONGEST_STEP) * (1 - EXACT)))


def steps_taken() -> list[float]:
    """The step at each of the display rates, s."""
    return [1 / (rate * steps_per_frame(rate)) for rate in DISPLAY_RATES]


def step_errors(
    calibrated: mujoco.MjModel, packed: mujoco.MjModel, duration: float, pull: float, tilts: Sequence[float]
) -> list[StepError]:
    """How far the tip of the packed model is from where the calibrated one has it, by display rate and steps a frame,
    up to those that are taken.

    Args:
        duration: s, pull: m, of the curl. tilts: gravity angles, rad.
    """
    start = curl(calibrated, duration, pull)
    expected = [simulate(calibrated, start, tilt).tip for tilt in tilts]
    reference_time = calibrated.opt.timestep * np.arange(len(start))
    errors = []
    for rate in DISPLAY_RATES:
        for count in range(1, steps_per_frame(rate) + 1):
            model = copy.copy(packed)
            model.opt.timestep = 1 / (rate * count)
            commands = curl(model, duration, pull)
            frames = np.arange(0, len(commands), count)
            at = np.minimum(frames * model.opt.timestep, reference_time[-1])
            motions = [simulate(model, commands, tilt) for tilt in tilts]
            error = None
            if not any(motion.warnings for motion in motions):
                wanted = [np.column_stack([np.interp(at, reference_time, axis) for axis in tip.T]) for tip in expected]
                gaps = [motion.tip[frames] - tip for motion, tip in zip(motions, wanted, strict=True)]
                error = round(1e3 * float(np.linalg.norm(gaps, axis=2).max()), 3)
            step = model.opt.timestep
            errors.append(StepError(display_rate=rate, steps_per_frame=count, step=step, tip_error_mm=error))
    return errors


def step_table(steps: Sequence[StepError]) -> str:
    """The same in Markdown, what is taken in bold."""
    rows = ["| display | steps a frame | step | tip error on a curl |", "|---:|---:|---:|---:|"]
    for entry in steps:
        taken = "**" if entry.steps_per_frame == steps_per_frame(entry.display_rate) else ""
        error = "diverges" if entry.tip_error_mm is None else f"{entry.tip_error_mm:.1f} mm"
        rows.append(
            f"| {entry.display_rate:g} Hz | {taken}{entry.steps_per_frame}{taken} "
            f"| {1e3 * entry.step:.1f} ms | {error} |"
        )
    return "\n".join(rows)


def with_steps(text: str, steps: Sequence[StepError]) -> str:
    """A text whose line `TABLE_HERE` gives way to the table, with all below it up to the next empty line."""
    before, marked, after = text.partition(f"{TABLE_HERE}\n")
    if not marked:
        return text
    _, _, rest = after.partition("\n\n")
    return f"{before}{step_table(steps)}\n\n{rest}"
