"""The same digits on every x86-64 processor. An environment matter, never a tracked parameter.

NumPy, OpenBLAS, Numba and PyTorch choose among variants of their loops by what the processor has, and these differ in
the last digits: a recording simulated on a processor with AVX-512 has other bytes than on one without. Here all are
held to AVX2, which processors have had since 2013 (Intel) and 2015 (AMD). So the same session gives the same
identified arm. MKL in PyTorch cannot be held without making training slower, so training leaves it out, see
`ik/network.py`, and gives the same network. What ONNX Runtime answers has last digits of its machine's.
"""

import os
from pathlib import Path

NEEDED = {"avx2", "bmi2", "fma", "movbe"}
HELD = {  # each library's own name of it
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",
    "NUMBA_CPU_NAME": "haswell",
    "NUMBA_CPU_FEATURES": "",
    "ATEN_CPU_CAPABILITY": "avx2",
}


def hold_arithmetic(cpuinfo: Path = Path("/proc/cpuinfo")) -> None:
    """To be called before NumPy is imported; what the environment already says stays. Nothing, where `cpuinfo` does not
    say that the processor has AVX2 (another processor, another system)."""
    if cpuinfo.is_file() and set(cpuinfo.read_text(errors="replace").split()) >= NEEDED:
        for name, value in HELD.items():
            os.environ.setdefault(name, value)
