"""A command ends in one line: for a user's mistake, and for a reader that has had enough."""

import subprocess
import sys

COMMAND = """
import sys
from trunkline.errors import InputError, in_one_line

@in_one_line
def main():
    {body}

sys.exit(main())
"""


def ended(body: str, **streams) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", COMMAND.format(body=body)], stderr=subprocess.PIPE, **streams)


def test_a_user_s_mistake_is_the_last_line():
    command = ended('raise InputError("a.yaml: found 1,\\nexpected 2")')
    assert command.communicate()[1] == b"error: a.yaml: found 1, expected 2\n"
    assert command.returncode == 1


def test_a_reader_that_has_had_enough_is_no_error():
    for body in ('print("line\\n" * 100_000)\n    return 0', 'print("line")\n    return 0'):
        command = ended(f"import time; time.sleep(0.2); {body}", stdout=subprocess.PIPE)
        command.stdout.close()
        assert command.stderr.read() == b""
        assert command.wait() == 1


def test_a_full_disk_is_one_line_and_a_mistake_in_the_code_is_none():
    command = ended('import errno\n    raise OSError(errno.ENOSPC, "No space left on device", "a.parquet")')
    assert command.communicate()[1] == b"error: [Errno 28] No space left on device: 'a.parquet'\n"
    assert command.returncode == 1
    assert b"Traceback" in ended("raise FileNotFoundError(2, 'gone')").communicate()[1]
