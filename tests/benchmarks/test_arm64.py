"""What is refused as a library for a Quest."""

from pathlib import Path

import pytest

from benchmarks import arm64
from trunkline.errors import InputError

LIBRARY = {
    "-hW": "  Machine:                           AArch64\n",
    "-dW": " 0x0000000000000001 (NEEDED)             Shared library: [libc.so]\n",
    "--dyn-syms": "  1310: 000000000020cd10   652 FUNC    GLOBAL DEFAULT   12 mj_step\n",
}


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
