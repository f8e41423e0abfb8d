"""Results do not depend on which x86-64 processor there is."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from trunkline.compute.numerics import HELD, NEEDED, hold_arithmetic

ROOT = Path(__file__).parents[2]
DIGITS = """
import {room}
import hashlib, numba, numpy, torch
x = numpy.random.default_rng(0).normal(size=(300, 300))
square = numba.njit(lambda v: (v * v).sum())
parts = [numpy.sin(x), numpy.exp(x), x @ x, x.sum(0), numpy.linalg.inv(x), square(x.ravel())]
parts.append(torch.from_numpy(x).std(0))
print(hashlib.sha256(b"".join(numpy.asarray(part).tobytes() for part in parts)).hexdigest())
"""
DIGEST = "6b00fd5e13a2f1d4be3bf15d2070a149592cc814232064f5ba6955ec53f8d38b"  # with AVX-512 and without, of both makers

TRAINED = """
import stages
import hashlib, numpy, torch
from trunkline.kinematics.ik.tip_loss import tip_loss
from trunkline.kinematics.ik.training import Training, train
rng = numpy.random.default_rng(0)
inputs, tensions = rng.normal(size=(1024, 8)), rng.choice([0.0, 1.0], (1024, 3))
commands = 0.01 * rng.normal(size=(1024, 3))
loss = tip_loss(tensions, rng.normal(size=(1024, 6, 3)), rng.normal(size=(1024, 3, 3)) - 3 * numpy.eye(3))
training = Training(width=64, epochs=2, batch=256, learning_rate=1e-3, seed=0)
network = train(inputs, commands, commands + 1e-3, loss, numpy.arange(1024) < 768, training, lambda *told: None)
print(hashlib.sha256(b"".join(part.detach().numpy().tobytes() for part in network.parameters())).hexdigest())
"""


def has_avx2() -> bool:
    cpuinfo = Path("/proc/cpuinfo")
    return cpuinfo.is_file() and set(cpuinfo.read_text().split()) >= NEEDED


ROOMS = ("stages", "demo", "studies", "benchmarks", "qualification", "rehearsal", "trunkline.ar.session")


@pytest.mark.skipif(not has_avx2(), reason="this processor has no AVX2: its last digits are its own")
@pytest.mark.parametrize("room", ROOMS)
def test_digits_are_those_of_other_machines(room):
    clean = {name: value for name, value in os.environ.items() if name not in HELD}
    clean |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    code = DIGITS.format(room=room)
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=clean, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == DIGEST


def test_a_processor_without_avx2_is_left_as_it_is(tmp_path, monkeypatch):
    for name in HELD:
        monkeypatch.delenv(name, raising=False)
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text("flags : fpu sse2 fma movbe bmi2\n")
    hold_arithmetic(cpuinfo)
    hold_arithmetic(tmp_path / "none")
    assert not HELD.keys() & os.environ.keys()
    cpuinfo.write_text("flags : fpu sse2 avx2 fma movbe bmi2\n")
    monkeypatch.setenv("ATEN_CPU_CAPABILITY", "default")
    hold_arithmetic(cpuinfo)
    assert os.environ["ATEN_CPU_CAPABILITY"] == "default"
    assert os.environ["OPENBLAS_CORETYPE"] == "Haswell"


def test_training_gives_the_same_network_whatever_mkl_chooses():
    """MKL chooses by the processor; `MKL_CBWR=COMPATIBLE` makes it choose as on none that is near this one."""
    found = {
        subprocess.run(
            [sys.executable, "-c", TRAINED], cwd=ROOT, env=os.environ | more, capture_output=True, text=True, check=True
        ).stdout
        for more in ({}, {"MKL_CBWR": "COMPATIBLE"})
    }
    assert len(found) == 1
