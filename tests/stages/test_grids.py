"""The reachability maps' file."""

import struct

import numpy as np

from stages.reachability import write_arrays

EXTRA = 28  # byte of a member's head that has the length of what Python 3.11.2 and 3.11.7 write otherwise


def test_grids_come_back_and_their_file_has_nothing_that_depends_on_python(tmp_path):
    arrays = {"soft_000": np.arange(12, dtype=np.float16).reshape(3, 4), "soft_origin": np.zeros(3)}
    write_arrays(tmp_path / "grids.npz", arrays)
    with np.load(tmp_path / "grids.npz") as read:
        assert read.files == [*arrays]
        for name, array in arrays.items():
            assert read[name].dtype == array.dtype
            np.testing.assert_array_equal(read[name], array)
    data = (tmp_path / "grids.npz").read_bytes()
    starts = [at for at in range(len(data)) if data.startswith(b"PK\x03\x04", at)]
    assert len(starts) == len(arrays)
    assert [struct.unpack_from("<H", data, start + EXTRA) for start in starts] == [(0,), (0,)]
