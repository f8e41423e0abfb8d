"""Read the sources of a checkout, or of another revision of it, as a dictionary from path to text."""

import ast
import io
import subprocess
import tarfile
from functools import cache
from pathlib import Path

from trunkline.errors import InputError

Sources = dict[str, str]  # path from the top of the checkout, with slashes, to text: Python and Markdown files
SUFFIXES = (".py", ".md")


def read_checkout(folder: Path) -> Sources:
    """Files that Git tracks in `folder` and new ones that it does not ignore, as they are on disk; no links."""
    listed = _git(folder, "ls-files", "-z", "--cached", "--others", "--exclude-standard").decode().split("\0")
    paths = {name: folder / name for name in sorted(set(listed)) if name.endswith(SUFFIXES)}
    files = {name: path for name, path in paths.items() if path.is_file() and not path.is_symlink()}
    return {name: path.read_text(encoding="utf-8") for name, path in files.items()}


def read_revision(folder: Path, revision: str) -> Sources:
    """The same files of a revision, by `git archive`; the working tree is left alone."""
    with tarfile.open(fileobj=io.BytesIO(_git(folder, "archive", "--format=tar", revision))) as archive:
        members = [member for member in archive if member.isfile() and member.name.endswith(SUFFIXES)]
        return {member.name: archive.extractfile(member).read().decode() for member in members}  # type: ignore[union-attr]


def python_in(sources: Sources, *folders: str) -> Sources:
    """The Python files in these top folders."""
    return {name: text for name, text in sources.items() if name.endswith(".py") and name.split("/")[0] in folders}


def code_in(sources: Sources) -> Sources:
    """All Python files but tests."""
    return {name: text for name, text in sources.items() if name.endswith(".py") and not name.startswith("tests/")}


@cache
def parse(text: str) -> ast.Module:
    """The tree of a source, parsed once: do not change it."""
    return ast.parse(text)


def _git(folder: Path, *arguments: str) -> bytes:
    """What a Git command prints.

    Raises:
        InputError: with Git's last line, where it fails.
    """
    done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True)
    if done.returncode:
        reason = done.stderr.decode().strip().splitlines()[-1:]
        raise InputError(f"git {arguments[0]} in {folder}: {' '.join(reason)}; expected a checkout and its revision")
    return done.stdout
