"""Benchmarks for headsets: how many steps a frame takes, and what is refused as a library for a Quest."""

from pathlib import Path

import pytest

from benchmarks import arm64
from benchmarks.headset import LONGEST, RATES, seconds_a_step, steps_a_frame
from tests.support.small_arm import small_spec
from trunkline.errors import InputError

LIBRARY = {
    "-hW": "  Machine:                           AArch64\n",
    "-dW": " 0x0000000000000001 (NEEDED)             Shared library: [libc.so]\n",
    "--dyn-syms": "  1310: 000000000020cd10   652 FUNC    GLOBAL DEFAULT   12 mj_step\n",
}


@pytest.mark.parametrize("rate", [*RATES, 250, 251])
def test_a_frame_takes_the_fewest_steps_that_are_short_enough(rate):
    steps = steps_a_frame(rate)
    assert 1 / (rate * steps) <= LONGEST * (1 + 1e-12)
    assert steps == 1 or 1 / (rate * (steps - 1)) > LONGEST


def test_a_step_at_which_the_arm_diverges_has_no_time():
    model = small_spec().compile()
    assert 0 < seconds_a_step(model, model.tendon_length0[:3], 0.001) < 0.01
    with pytest.raises(InputError, match="step of 100 ms: found a warning"):
        seconds_a_step(model, model.tendon_length0[:3] - 0.05, 0.1)


@pytest.mark.parametrize(
    ("flag", "text", "said"),
    [
        ("-hW", "  Machine:   Advanced Micro Devices X86-64\n", "Advanced Micro Devices X86-64"),
        ("--dyn-syms", "  13: 00000000020cd10   652 FUNC    GLOBAL DEFAULT   12 mj_step1\n", "exported': 'no'"),
    ],
)
def test_another_library_is_refused(flag, text, said, monkeypatch, tmp_path, capsys):
    told = dict(LIBRARY)
    monkeypatch.setattr(arm64, "run", lambda program, option, *more: told[option])
    arm64.show(Path("libmujoco.so"), tmp_path, None, tmp_path)
    assert "| C library of | Android |" in capsys.readouterr().out
    told[flag] = text
    with pytest.raises(InputError, match=said):
        arm64.show(Path("libmujoco.so"), tmp_path, None, tmp_path)
