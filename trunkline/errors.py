"""The exception that ends a stage or a command in one line, a user's mistake; the commonest is a missing file."""

import difflib
import errno
import os
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError

UNWRITABLE = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EFBIG}  # the disk's business, not the code's


class InputError(Exception):
    """A user's mistake: bad log, bad parameter, missing file.

    The message is one line that names the file, topic or key, what was found and what was expected.
    Stages and commands print it as `error: <message>` and exit with code 1, without a traceback.
    """

    def __str__(self) -> str:
        return " ".join(super().__str__().split())


def in_one_line(main: Callable[..., int]) -> Callable[..., int]:
    """A command's `main`, whose InputError becomes its last line, on stderr, and exit code 1.

    Where a reader such as `head` has had enough, the command ends quietly with exit code 1.
    """

    @wraps(main)
    def command(*args) -> int:
        try:
            code = main(*args)
            sys.stdout.flush()
            return code
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left to flush at exit
            return 1
        except (InputError, OSError) as error:
            if isinstance(error, OSError) and error.errno not in UNWRITABLE:
                raise
            sys.stdout.flush()
            print(f"error: {error}", file=sys.stderr)
            return 1

    return command


def first_problem(error: "ValidationError") -> str:
    """What pydantic said first: `key.0: Input should be …`."""
    problem = error.errors()[0]
    return f"{'.'.join(map(str, problem['loc'])) or 'the whole'}: {problem['msg']}"


def nearest(name: str, valid: list[str]) -> str:
    """ ", did you mean 'x'?" for the one of `valid` that is most like `name`; empty where none is."""
    matches = difflib.get_close_matches(name, valid, n=1)
    return f", did you mean {matches[0]!r}?" if matches else ""


def existing(path: str | Path) -> Path:
    """`path`, which an earlier stage wrote.

    Raises:
        InputError: there is no such file.
    """
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file, expected what an earlier stage writes (run `dvc repro`)")
    return Path(path)
