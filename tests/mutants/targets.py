"""Which mutants there are, which of them a run is of, and the reasons why some may survive."""

import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import yaml

from tests.mutants.operators import Mutant, mutants

TARGETS, EDITS, EQUIVALENT = "targets.yaml", "edits.yaml", "equivalent.yaml"


def read_targets(folder: Path, root: Path) -> list[Mutant]:
    """The mutants of all targets that `folder` lists, of files in `root`.

    Raises:
        ValueError: a target names what is not there, the old text of an edit is not there exactly once, or a mutant
            comes twice.
    """
    targets, edits = (yaml.safe_load((folder / name).read_text(encoding="utf-8")) for name in (TARGETS, EDITS))
    every = [*_made(targets, root), *_edited(edits, root)]
    keys: set[str] = set()
    for mutant in every:
        if mutant.key in keys:
            raise ValueError(f"{folder / TARGETS}: found twice: {mutant.key}")
        keys.add(mutant.key)
    return every


def read_reasons(folder: Path) -> dict[str, str]:
    """By the keys of mutants that may survive, why."""
    reasons: dict[str, str] = {}
    for why, keys in (yaml.safe_load((folder / EQUIVALENT).read_text(encoding="utf-8")) or {}).items():
        reasons |= dict.fromkeys(keys, why)
    return reasons


def drawn(every: list[Mutant], reasons: dict[str, str], count: int, seed: str) -> list[Mutant]:
    """A sample of those that have to be killed, the same for the same seed, in their order."""
    others = [mutant for mutant in every if mutant.key not in reasons]
    numbers = random.Random(seed).sample(range(len(others)), min(count, len(others)))
    return [others[number] for number in sorted(numbers)]


def _made(targets: dict[str, list[dict]], root: Path) -> Iterator[Mutant]:
    for path, groups in targets.items():
        text = (root / path).read_text(encoding="utf-8")
        for group in groups:
            for mutant in mutants(path, text, group["of"]):
                yield replace(mutant, tests=tuple(group["tests"]))


def _edited(groups: list[dict], root: Path) -> Iterator[Mutant]:
    for group in groups:
        path, tests = group["file"], tuple(group["tests"])
        text = (root / path).read_text(encoding="utf-8")
        for edit in group["edits"]:
            name, old, new = edit["id"], edit["old"], edit["new"]
            if text.count(old) != 1:
                raise ValueError(f"{path}: {name}: found {text.count(old)} times, expected once: {old!r}")
            bug = edit.get("bug") or f"{' '.join(old.split())} -> {' '.join(new.split()) or 'nothing'}"
            line = text.count("\n", 0, text.index(old)) + 1
            yield Mutant(path, name, bug, line, text.replace(old, new), tests)
