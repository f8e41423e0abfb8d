"""A small session as logs, and the same numbers as the columns of a table."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from demo.instruments import Measurement, measure
from demo.recorder import write_log, write_session
from tests.support.sessions import LIMITS, curl_truth, instruments, release_truth
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.session.session import read_session
from trunkline.recordings.trials.raw_trial import RawTrial

Columns = dict[str, np.ndarray]


def measured() -> list[Measurement]:
    """A curl and a release with hidden bodies; motors are sampled with the cameras."""
    clean = instruments(stamp_jitter_ms=0, dropped_frames=0, outliers=0, occlusions_per_s=0.6)
    both = []
    for number, truth in enumerate((curl_truth(split="identify"), release_truth("identify"))):
        m = measure(truth, clean, np.random.default_rng(number), 30.0 * number)
        pulls = np.zeros((len(m.stamps), len(m.tendons)))
        if len(m.tendons):
            pulls = m.commands[np.searchsorted(m.command_stamps, m.stamps).clip(max=len(m.commands) - 1)]
        both.append(replace(
            m, logged=m.stamps, command_stamps=m.stamps, command_logged=m.stamps, commands=pulls,
            tendon_stamps=m.stamps, tendon_logged=m.stamps, tendon_positions=0.999 * pulls,
        ))  # fmt: skip
    return both


def columns_of(m: Measurement, unit: float = 1.0) -> Columns:
    """Time in s, frame, `base_x` … `base_qz`, `unit_02_x` …, `cmd_1` …, `pos_1` …; NaN where nothing was seen."""
    columns: Columns = {"t": (m.stamps - m.stamps[0]) * 1e-9 + 5.0, "frame": m.frames.astype(float)}
    for place, body in enumerate(m.bodies):
        columns |= {f"{body}_{axis}": unit * m.positions[:, place, i] for i, axis in enumerate("xyz")}
        columns |= {f"{body}_q{axis}": m.quaternions[:, place, i] for i, axis in enumerate("wxyz")}
    for place in range(len(m.tendons)):
        columns |= {f"cmd_{place + 1}": m.commands[:, place], f"pos_{place + 1}": m.tendon_positions[:, place]}
    return {name: values.copy() for name, values in columns.items()}


def layout_of(m: Measurement) -> dict:
    """`tables` of session.yaml that reads `columns_of`."""
    bodies = {
        body: {"position": [f"{body}_{axis}" for axis in "xyz"], "quaternion": [f"{body}_q{axis}" for axis in "wxyz"]}
        for body in m.bodies
    }
    layout = {"time": {"column": "t", "unit": "s"}, "bodies": bodies, "quaternion": "wxyz"}
    for key, word in (("commands", "cmd"), ("tendon_positions", "pos")):
        if m.tendons:
            layout[key] = {tendon: f"{word}_{place + 1}" for place, tendon in enumerate(m.tendons)}
    return layout


def trial_of(m: Measurement, **more) -> dict:
    entry = {"name": m.name, "file": f"{m.name}.csv", "experiment": m.experiment, "split": m.split}
    return entry | ({} if m.level is None else {"level": m.level}) | more


def write_declared(folder: Path, tables: dict, trials: list[dict], **more) -> None:
    """session.yaml."""
    content = {"frame": {"up": [0, 1, 0]}, "base": "base", "tables": tables, "trials": trials} | more
    (folder / "session.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def write_text(
    path: Path, columns: Columns, separator=",", decimal=".", encoding="utf-8", above=(), names=True, blank="", below=()
) -> None:
    lines = [*above, separator.join(columns)] if names else list(above)
    lines += below
    for row in zip(*columns.values(), strict=True):
        lines.append(separator.join(cell(value, blank).replace(".", decimal) for value in row))
    path.write_text("\n".join(lines) + "\n", encoding=encoding)


def cell(value, blank: str) -> str:
    return value if isinstance(value, str) else blank if np.isnan(value) else repr(float(value))


def raw_trials(folder: Path) -> dict[str, RawTrial | Exception]:
    return {trial.name: raw for trial, raw, _ in load_raw_trials(folder, read_session(folder), LIMITS)}


def logged(folder: Path) -> dict[str, RawTrial | Exception]:
    """The raw trials of the same session as logs."""
    folder.mkdir()
    both = measured()
    for m in both:
        write_log(folder / f"{m.name}.mcap", m)
    write_session(folder, both, instruments())
    path = folder / "session.yaml"
    path.write_text(path.read_text().replace("clock: frame", "clock: stamp"))
    return raw_trials(folder)


def assert_equal(raw: RawTrial | Exception, right: RawTrial | Exception) -> None:
    assert isinstance(raw, RawTrial), raw
    assert isinstance(right, RawTrial), right
    assert (raw.markers, raw.tendons, raw.experiment, raw.level) == (
        right.markers, right.tendons, right.experiment, right.level)  # fmt: skip
    for name in ("time", "positions", "base_positions", "command_time", "commands", "tendon_time", "tendon_positions"):
        np.testing.assert_allclose(getattr(raw, name), getattr(right, name), atol=1e-6, err_msg=name)
    for name in ("quaternions", "base_quaternions"):
        ours, theirs = getattr(raw, name), getattr(right, name)
        sign = np.sign(np.nansum(ours * theirs, axis=-1, keepdims=True))
        np.testing.assert_allclose(ours * np.where(sign == 0, 1, sign), theirs, atol=1e-6, err_msg=name)
