"""The time step in Unity: whole steps a frame, none too long, in Python and C#; what they cost; who falls behind."""

import math
import subprocess

import mujoco
import pytest

from tests.support.small_arm import small_spec
from tests.unity.mono import compiled
from tests.unity.test_csharp import TESTS
from trunkline.unity.assemble import CSHARP
from trunkline.unity.manifest import StepError
from trunkline.unity.pulls import as_pulls
from trunkline.unity.time_steps import (
    DISPLAY_RATES,
    LONGEST_STEP,
    TABLE_HERE,
    step_errors,
    step_table,
    steps_per_frame,
    steps_taken,
    with_steps,
)

CURL = {"duration": 0.4, "pull": 0.03, "tilts": [0.0, 1.0]}


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    sources = [CSHARP / "Pace.cs", *(TESTS / "pace").glob("*.cs")]
    return compiled(tmp_path_factory.mktemp("pace") / "pace.exe", sources)


def output_of(program, what: str, numbers) -> list[str]:
    words = {math.inf: "Infinity"}
    values = ["NaN" if math.isnan(number) else words.get(number, repr(number)) for number in numbers]
    arguments = ["mono", str(program), what, ",".join(values)]
    return subprocess.run(arguments, capture_output=True, text=True, check=True).stdout.splitlines()


@pytest.mark.parametrize("rate", [*DISPLAY_RATES, 59.94, 250.0, 500.0])
def test_steps_are_whole_parts_of_a_frame_and_as_few_as_may_be(program, rate):
    count = steps_per_frame(rate)
    step = 1 / (rate * count)
    assert step <= LONGEST_STEP * (1 + 1e-8)
    assert count == 1 or 1 / (rate * (count - 1)) > LONGEST_STEP
    ((steps, length),) = (line.split() for line in output_of(program, "step", [rate, LONGEST_STEP]))
    assert (int(steps), float(length)) == (count, pytest.approx(step))


def test_the_steps_of_common_displays(program):
    assert [steps_per_frame(rate) for rate in (60, 72, 90, 120)] == [5, 4, 3, 3]
    assert max(steps_taken()) <= LONGEST_STEP
    silent = [output_of(program, "step", [rate, LONGEST_STEP]) for rate in (0.0, math.nan, math.inf, -1.0)]
    assert silent == 4 * [output_of(program, "step", [60.0, LONGEST_STEP])]


def test_a_device_that_falls_behind_for_two_seconds_is_told_by_how_much(program):
    frame = 1 / 72
    slow = [value for _ in range(216) for value in (frame, 0.62 * frame)]
    *lines, warning = output_of(program, "keep", slow)
    full = [line.split() for line in lines if line.startswith("True")]
    assert [float(share) for _, share, _ in full] == pytest.approx([0.62, 0.62])
    assert [behind for *_, behind in full] == ["False", "True"]  # the first second may be a hitch
    assert warning.startswith("Trunkline: found 62 % of real time simulated in steps of 4.0 ms, expected 100 %")
    well = [value for k in range(288) for value in (frame, 0.0 if k == 100 else frame)]
    assert all(line.endswith("False") for line in output_of(program, "keep", well)[:-1])


@pytest.fixture(scope="module")
def models() -> tuple[mujoco.MjModel, mujoco.MjModel]:
    spec = small_spec()
    calibrated = spec.compile()
    as_pulls(spec)
    return calibrated, spec.compile()


def test_shorter_steps_err_less(models):
    errors = step_errors(*models, **CURL)
    assert [(error.display_rate, error.steps_per_frame) for error in errors] == [
        (rate, count) for rate in DISPLAY_RATES for count in range(1, steps_per_frame(rate) + 1)
    ]
    for error in errors:
        assert error.step == pytest.approx(1 / (error.display_rate * error.steps_per_frame))
    taken = [error for error in errors if error.steps_per_frame == steps_per_frame(error.display_rate)]
    longer = [error for error in errors if error.step > LONGEST_STEP]
    worst = [math.inf if error.tip_error_mm is None else error.tip_error_mm for error in longer]
    assert max(error.tip_error_mm for error in taken) < min(worst)


def test_the_calibrated_step_errs_nothing_and_one_that_diverges_says_so(models, monkeypatch):
    calibrated, packed = models
    monkeypatch.setattr("trunkline.unity.time_steps.DISPLAY_RATES", (1000.0,))  # the time step of the small arm
    assert [error.tip_error_mm for error in step_errors(calibrated, packed, **CURL)] == [pytest.approx(0, abs=1e-3)]
    loose = small_spec(kp=2e7, kv=0.0)
    as_pulls(loose)
    monkeypatch.setattr("trunkline.unity.time_steps.DISPLAY_RATES", (30.0,))
    monkeypatch.setattr("trunkline.unity.time_steps.LONGEST_STEP", 1.0)
    (diverged, *_) = step_errors(calibrated, loose.compile(), **CURL)
    assert diverged.tip_error_mm is None
    assert "| 30 Hz | **1** | 33.3 ms | diverges |" in step_table([diverged])


def test_the_table_takes_the_place_that_a_text_leaves_it():
    rows = [StepError(display_rate=72, steps_per_frame=n, step=1 / 72 / n, tip_error_mm=9.0 / n) for n in (3, 4)]
    text = f"before\n\n{TABLE_HERE}\nThe package has it.\n\nafter\n"
    text_with_table = with_steps(text, rows)
    assert text_with_table == f"before\n\n{step_table(rows)}\n\nafter\n"
    assert "| 72 Hz | 3 | 4.6 ms | 3.0 mm |" in text_with_table
    assert "| 72 Hz | **4** | 3.5 ms | 2.2 mm |" in text_with_table
    assert with_steps("no place", rows) == "no place"


def test_the_manual_leaves_it_a_place_once(pytestconfig):
    text = (pytestconfig.rootpath / "docs/unity.md").read_text()
    assert text.count(TABLE_HERE) == 1
