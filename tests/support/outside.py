"""Recordings and models as others have them (../shared/cases), each with one fault: what becomes of it, in words.

Each goes through what the command in its README goes through. Of what works the words hold the values that a fault
would change; what is refused gives its one line.
"""

import contextlib
import io
import re
import shutil
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf

from stages.build_mjcf import Config as BuildConfig
from stages.build_mjcf import main as build
from tests.model.arm.test_sections import ACTUATION, SOLVER
from tests.support.folders import CASES, ROOT
from tests.support.sessions import LIMITS, PLAUSIBLE
from trunkline.errors import InputError
from trunkline.identification.simulate.experiment import prepare
from trunkline.model.arm.from_file import FromFile
from trunkline.model.arm.guide_holes import GuideHoles
from trunkline.model.arm.joints import Joints
from trunkline.model.places import marker_places
from trunkline.model_files import read_spec
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.session_checks import CheckedSession, check_session
from trunkline.recordings.filtering.filter import Filter, filter_raw_trial
from trunkline.recordings.preparation.inspect import main as inspect
from trunkline.recordings.preparation.motive import main as import_motive
from trunkline.recordings.session.session import read_session
from trunkline.recordings.signals.base_frame import average_base, to_base_frame
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.tools.check.up_axis import other_ups, up_lines
from trunkline.tools.describe.__main__ import main as describe

COMMON, HONEST = "00-common", "00-honest"
FILTER = Filter(rate=120, cutoff=20, order=4, longest_bridge=0.06, outlier_deviations=8, release="onset")
OF_EVERY = ("splits: no trial of the split ", "experiments: no ")  # what is said of every such session
TENDONS = "tendons: {a: a, b: b, c: c}\n"


def outcome(case: str, scratch: Path) -> str:
    """What becomes of a case, in words. scratch: an empty folder."""
    try:
        words = OUTCOMES[case](CASES / case, scratch)
    except InputError as error:
        words = f"refused: {error}"
    return re.sub(rf"({scratch}|{CASES / case})(/session)?/?", "", words)


def session_lines(gathered: CheckedSession) -> list[str]:
    """What is said of a session's trials, repaired, doubted or refused, each once."""
    lines = [f"refused: {reason}" for reason in gathered.refused.values()]
    for record in gathered.findings:
        lines += [f"repaired: {line}" for line in record.repairs] + [f"warning: {line}" for line in record.warnings]
    return [line for line in dict.fromkeys(lines) if not line.removeprefix("warning: ").startswith(OF_EVERY)]


def taken_in(folder: Path, **changes) -> CheckedSession:
    """A session as `ingest` takes it in. changes: of session.yaml."""
    arm = marker_places(read_spec(CASES / COMMON / "own_links.xml").compile())
    session = read_session(folder).model_copy(update=changes)
    return check_session(load_raw_trials(folder, session, LIMITS, arm), session, PLAUSIBLE, "leave_out", "session", arm)


def _works(gathered: CheckedSession, *facts: str) -> str:
    count = f"{len(gathered.raw_trials)} trials, {sum(len(raw.time) for raw in gathered.raw_trials)} frames"
    return "; ".join([f"works: {count}", *facts, *(session_lines(gathered) or ["not a word"])])


def _session(*facts: Callable[[CheckedSession], str]) -> Callable[[Path, Path], str]:
    def words(case: Path, scratch: Path) -> str:
        gathered = taken_in(case / "session")
        return _works(gathered, *(fact(gathered) for fact in facts))

    return words


def _first_refused(case: Path, scratch: Path) -> str:
    return next(iter(taken_in(case / "session").refused.values()), "nothing is refused")


# --- facts of a session


def _reach(gathered: CheckedSession) -> str:
    raw = gathered.raw_trials[0]
    apart = np.linalg.norm(np.nanmedian(raw.positions - raw.base_positions[:, None], axis=0), axis=1)
    return f"{raw.markers[int(apart.argmax())]} {1e2 * apart.max():.0f} cm from the base"


def _base(gathered: CheckedSession) -> str:
    return f"base at {np.round(np.median(gathered.raw_trials[0].base_positions, axis=0), 2).tolist()}"


def _markers(gathered: CheckedSession) -> str:
    return f"markers {', '.join(sorted(gathered.raw_trials[0].markers))}"


def _rate(gathered: CheckedSession) -> str:
    return f"at {', '.join(sorted({f'{1 / np.median(np.diff(raw.time)):.0f}' for raw in gathered.raw_trials}))} Hz"


def _driven(gathered: CheckedSession) -> list[RawTrial]:
    return [raw for raw in gathered.raw_trials if raw.commands.size and raw.experiment != "static_tilt"]


def _as_honest(gathered: CheckedSession) -> str:
    """How far commands and measured positions are from those of the honest session, at most; the latter but for where
    an encoder starts."""
    words = []
    for what, key, clock in (("commands", "commands", "command_time"), ("encoders", "tendon_positions", "tendon_time")):
        off = []
        for raw in _driven(gathered):
            if len(getattr(raw, clock)):
                both = raw, _honest()[raw.name]
                pulls, right = (_at(raw.time, getattr(each, clock), getattr(each, key)) for each in both)
                start = np.median(pulls - right, axis=0) if what == "encoders" else 0.0
                off.append(np.abs(pulls - right - start).max())
        words.append(f"{what} within {1e3 * max(off):.1f} mm" if off else f"no {what}")
    return f"as in {HONEST}: {', '.join(words)}"


def _at(when: np.ndarray, time: np.ndarray, pulls: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(when, time, pull) for pull in pulls.T], axis=1)


@cache
def _honest() -> dict[str, RawTrial]:
    return {raw.name: raw for raw in taken_in(CASES / HONEST / "session").raw_trials}


def _slowest_change(gathered: CheckedSession) -> str:
    """How long the longest change of a command takes."""
    changes = [
        np.diff(raw.command_time)[(np.abs(np.diff(raw.commands, axis=0)) > 1e-6).any(axis=1)].max(initial=0.0)
        for raw in _driven(gathered)
    ]
    return f"a command changes within {1e3 * max(changes):.0f} ms"


def _deepest(gathered: CheckedSession) -> str:
    pulls = {raw.name: 1e3 * np.median(raw.commands, axis=0) for raw in _driven(gathered)}
    return "; ".join(f"{name} {', '.join(f'{pull:.0f}' for pull in some)} mm" for name, some in sorted(pulls.items()))


def _smooth(gathered: CheckedSession) -> str:
    """How far filtered positions are from measured ones, at most, where they are measured."""
    off = []
    for raw in gathered.raw_trials:
        trial = filter_raw_trial(raw, FILTER)[0]
        if len(trial.time) > 1:
            base = average_base(raw.base_positions, raw.base_quaternions)
            local = to_base_frame(base, raw.positions, raw.quaternions)[0]
            for index in range(len(raw.markers)):
                visible = np.isfinite(local[:, index, 0])
                there = [np.interp(raw.time[visible], trial.time, axis) for axis in trial.positions[:, index].T]
                off.append(np.linalg.norm(np.transpose(there) - local[visible, index], axis=1).max())
    return f"filtered within {1e3 * max(off):.0f} mm of what was measured"


# --- cases with steps of their own


def _clocks(case: Path, scratch: Path) -> str:
    words = []
    for clock in ("stamp", "log", "frame"):
        gathered = taken_in(case / "session", clock=clock)
        words.append(f"clock: {clock}: {_works(gathered)}")
    return "; ".join(words)


def _inspected(folder: Path) -> str:
    """The session.yaml that `inspect` proposes."""
    printed = _printed(inspect, [str(folder)])
    return printed.partition("Proposed session.yaml:\n")[2]


def _proposed(case: Path, scratch: Path) -> str:
    """A session as its proposal has it."""
    for log in (case / "session").rglob("*.mcap"):
        link = scratch / log.relative_to(case / "session")
        link.parent.mkdir(exist_ok=True)
        link.symlink_to(log)
    (scratch / "session.yaml").write_text(_inspected(scratch).replace("topics:", f"{TENDONS}topics:"))
    levels = [f"{trial.level:g}" for trial in read_session(scratch).trials if trial.level is not None]
    return f"proposed levels {', '.join(levels)}; {_works(taken_in(scratch))}"


def _beside_a_robot(case: Path, scratch: Path) -> str:
    proposed = re.search("topics:.*", _inspected(case / "session"))
    return f"proposed {proposed[0] if proposed else 'nothing'}; {_session(_as_honest)(case, scratch)}"


def _motive(*options: str, facts: Iterable[Callable] = ()) -> Callable[[Path, Path], str]:
    def words(case: Path, scratch: Path) -> str:
        exports = [str(path) for path in sorted(case.rglob("*.csv"))]
        printed = _printed(import_motive, ["--session", str(scratch), *options, *exports])
        if printed.startswith("error: "):
            return f"refused: {printed.removeprefix('error: ').strip()}"
        first, *warnings = [line for line in printed.splitlines() if "session.yaml" not in line]
        session = read_session(scratch)
        levels = [f"{trial.level:g}" for trial in session.trials if trial.level is not None]
        parts = [f"works: {first}", *warnings, f"up {list(session.frame.up)}"]
        parts += [f"levels {', '.join(levels)}"] if levels else []
        return "; ".join([*parts, *(fact(taken_in(scratch)) for fact in facts)])

    return words


def _remarks(gathered: CheckedSession) -> str:
    return "; ".join(session_lines(gathered) or ["not a word"])


def _with_a_unit(case: Path, scratch: Path) -> str:
    with_it = _motive("--unit", "meters", facts=[_reach])
    return f"{_motive()(case, scratch)}; with --unit meters: {with_it(case, scratch)}"


def _advised(case: Path, scratch: Path) -> str:
    """What `check` advises beside parameters, by one of the session's pulls."""
    raw_trials = taken_in(case / "session").raw_trials
    model, markers = read_spec(CASES / COMMON / "own_links.xml").compile(), raw_trials[0].markers
    pulls = [raw for raw in raw_trials if raw.experiment == "static_pull"][:1]
    experiments = [prepare(filter_raw_trial(raw, FILTER)[0], model, 1) for raw in pulls]
    return "; ".join(up_lines(model, experiments, markers, other_ups(raw_trials)) or ["no advice"])


def _models(case: Path, scratch: Path) -> str:
    """Each model as `describe` and `build_mjcf` take it."""
    lines = []
    for path in sorted(case.glob("*.xml")):
        described = _printed(describe, [str(path), "--out", str(scratch / "arm.png")])
        built = _built(path, scratch)
        described = described.removeprefix("error: ").strip() if described.startswith("error: ") else "taken"
        same = "" if built in described or described in built else f"; by build_mjcf: {built}"
        lines.append(f"{path.name}: {described.rpartition('.xml: ')[2]}{same}")
    return "; ".join(lines)


def _built(path: Path, scratch: Path) -> str:
    with contextlib.chdir(scratch):
        models = scratch / "conf/build_mjcf/mjcf"
        models.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, models)
        try:
            build(BuildConfig(arm=FromFile("mjcf", path.name), joints=Joints(), holes=GuideHoles(), actuation=ACTUATION,
                              solver=SOLVER))  # fmt: skip
        except InputError as error:
            return str(error).rpartition(".xml: ")[2]
    return "taken"


def bench(folder: Path, case: str, params: str) -> Path:
    """Make `folder` a project on a case's session, with these of the common settings."""
    shutil.copytree(ROOT / "conf", folder / "conf")
    for name, group in (("own_links.xml", "mjcf"), ("own_links.yaml", "arm")):
        shutil.copy(CASES / COMMON / name, folder / "conf/build_mjcf" / group)
    settings = OmegaConf.load(CASES / COMMON / params)
    settings.ingest.session = case
    OmegaConf.save(settings, folder / "params.yaml")
    OmegaConf.save({"stages": {str(name): {} for name in settings}}, folder / "dvc.yaml")
    (folder / "data/raw").mkdir(parents=True)
    (folder / "data/raw" / case).symlink_to(CASES / case / "session")
    return folder


def _printed(command: Callable[[list[str]], int], arguments: list[str]) -> str:
    """What a command prints: its error alone, where it ends with one."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        failed = command(arguments)
    return error.getvalue() if failed else out.getvalue() + error.getvalue()


OUTCOMES: dict[str, Callable[[Path, Path], str]] = {
    "00-honest": _session(_as_honest),
    "00-honest-steps": _session(_slowest_change),
    "01-commands-on-change": _session(_slowest_change),
    "03-two-publishers-zeros-between": _first_refused,
    "05-one-topic-in-another-frame": _session(),
    "06-centimetres": _session(_reach),
    "08-positions-turned-attitudes-not": _session(),
    "09-left-handed": _session(),
    "11-each-pose-four-times": _session(_rate),
    "12-advice-on-up-of-an-honest-session": _advised,
    "15-motive-z-up": _motive(facts=[_remarks]),
    "16-motive-takes-of-one-name": _motive(),
    "17-first-stamp-zero": _clocks,
    "21-messages-compressed-one-by-one": _session(_reach),
    "22-schema-without-definition": _session(_reach),
    "23-cdr2-encapsulation": _session(),
    "24-marker-fields-of-before": _session(_markers),
    "26-json-zeros-left-out": _session(_base),
    "27-one-message-per-motor": _session(_as_honest),
    "29-joints-without-names": _session(_as_honest),
    "31-robot-joint-states-beside": _beside_a_robot,
    "32-encoder-wraps": _session(_as_honest),
    "34-proposed-levels-of-curls": _proposed,
    "35-motive-more-frames-in-header": _motive(),
    "36-motive-1-1-without-unit": _with_a_unit,
    "37-vicon-nexus-csv": _motive(),
    "39-folder-per-bag": _proposed,
    "42-base-topic-in-another-frame": _session(),
    "47-motive-unlabelled-markers": _motive(),
    "48-command-sent-before-recording": _session(_as_honest, _deepest),
    "50-topic-per-motor": _session(_as_honest),
    "51-stamps-of-arrival": _session(_rate, _smooth),
    "52-newer-and-older-mocap-messages": _session(_reach),
    "53-describe-models-of-others": _models,
    "54-mjcf-wind": _models,
    "55-mjcf-messages": _models,
    "56-describe-takes-what-build-refuses": _models,
    "57-mjcf-parallel-hinges": _models,
    "59-bursts-in-the-log": _session(_rate, _smooth),
}
