"""A drift monitor: a model, a reference, a folder of sessions, and the results so far."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from trunkline.compute.progress import progress
from trunkline.errors import InputError
from trunkline.identification.simulate.checks import check_trials
from trunkline.model.places import marker_places
from trunkline.pipeline.config import settings_of
from trunkline.pipeline.stage import output_folder
from trunkline.recordings.trials.splits import DECIDING
from trunkline.settings import read_yaml
from trunkline.tools.evaluate.model import written_beside
from trunkline.tools.evaluate.session import trials_of
from trunkline.tools.monitor.attribution import attribute_change
from trunkline.tools.monitor.baseline import Baseline
from trunkline.tools.monitor.control_chart import Chart, chart_of
from trunkline.tools.monitor.history import History, alone, digest, read_score, score_row
from trunkline.tools.monitor.inbox import name_of, planned, sessions_of, state_of, without_session
from trunkline.tools.monitor.loading import load_logs
from trunkline.tools.monitor.pending import PendingFiles
from trunkline.tools.monitor.scores import Score, Scorer, watched_in
from trunkline.tools.monitor.words import change_lines, chart_table, outlier_lines, reference_lines, trial_line
from trunkline.twin.twin import Twin

LEARN = 15  # trials of each kind that stand for the unchanged arm, where no reference is given
STAGES = ("identify_damping", "identify_control", "identify_stiffness")  # whose loss weighs the residuals


@dataclass
class DriftMonitor:
    """folder: that is looked at. out: what is written to. reference: scores of the unchanged arm, or none to learn
    them. chart: of all trials so far."""

    folder: Path
    out: Path
    settings: Path
    scorer: Scorer
    history: History
    reference: list[Score]
    pending: PendingFiles

    def __post_init__(self):
        self.chart, self.wheres = self._chart()

    @classmethod
    @contextmanager
    def begun(
        cls, model: Path, folder: Path, reference: Path | None, out: Path, settings: Path
    ) -> Iterator["DriftMonitor"]:
        """From the arguments of the command, going on from what `out` holds.

        Raises:
            InputError: the model is none, does not fit the reference, or `out` is of another.
        """
        scorer = scorer_of(model, settings)
        sessions_of(folder)  # is there
        made_of = {"model": digest(model), "parameters": list(scorer.parameters)}
        with alone(out):
            history = History.opened(out / "scores.jsonl", made_of)
            scores, is_new = [], False
            if reference is not None:
                scores, is_new = reference_scores(reference, scorer, out, made_of, settings)
            monitor = cls(folder, out, settings, scorer, history, scores, PendingFiles(out / "awaited.json"))
            if is_new:
                print("\n".join(f"monitor: {line}" for line in reference_lines(
                    monitor.chart.baseline, monitor.chart, scorer.parameters)), flush=True)  # fmt: skip
            for line in monitor._alarm():
                print(f"monitor: {line}", flush=True)
            yield monitor

    def look(self) -> int:
        """Score new trials, print a line for each, and write the chart. Returns how many inputs cannot be used, those
        of earlier looks left aside."""
        unusable, scored = 0, False
        for folder in without_session(self.folder):
            self.pending.say(f"{folder}", f"{folder}: found logs and no session.yaml, which says what they are: waits")
        for session in sessions_of(self.folder):
            try:
                new = self._new(session)
                if new:
                    any_scored, refused = self._score(session, new)
                    scored, unusable = scored or any_scored, unusable + refused
                self.pending.forget(f"{session}")
            except InputError as error:
                unusable += self.pending.say(f"{session}", str(error))
        if scored or not (self.out / "chart.png").is_file():
            self._write()
        return unusable

    def _new(self, session: Path) -> dict[str, str]:
        """Trials that have not been scored and whose log is there and whole, with the mark of its state."""
        marks, described = {}, state_of(session / "session.yaml")
        for trial in planned(session):
            name, log = name_of(trial), session / str(trial["file"])
            row, state = self.history.of(session.name, name), state_of(log)
            if state is None or described is None:
                continue
            scored = row is not None and "slope" in row
            mark = state.mark if scored else f"{state.mark} {described.mark}"  # a mistake may be session.yaml's
            if row is not None and row["mark"].startswith(mark):
                continue
            if row is not None and scored:
                self._say_changed(log, row)
            elif self.pending.ready(log, state):
                marks[name] = f"{state.mark} {described.mark}"
        return marks

    def _say_changed(self, log: Path, row: dict) -> None:
        if digest(log) != row["log"]:  # not merely copied anew
            message = "changed after it was scored, which stands; give it another name to have it scored again"
            self.pending.say(f"{log}", f"{log}: {message}")

    def _score(self, session: Path, new: dict[str, str]) -> tuple[bool, int]:
        """Whether any of the `new` trials was scored, and how many were refused."""
        entries = {name_of(trial): str(trial["file"]) for trial in planned(session)}
        there = {file for file in entries.values() if (state := state_of(session / file)) is not None
                 and self.pending.ready(session / file, state)}  # fmt: skip
        taken, scored, unusable = load_logs(session, there, self.settings, marker_places(self.scorer.model)), False, 0
        for name, mark in new.items():
            row = {"session": session.name, "trial": name, "mark": mark, "log": digest(session / entries[name])}
            where = f"{session.name}/{name}"
            try:
                if name not in taken.trials:
                    raise InputError(taken.refused.get(name, f"{session}: trial {name}: left out"))
                trial = taken.trials[name]
                check_trials([trial], self.scorer.model)
                score = self.scorer.score(trial)
            except InputError as error:
                print(f"monitor: {where}: refused: {error}", flush=True)
                self.history.add(**row, refused=str(error))
                unusable += 1
                continue
            self.history.add(**row, repairs=trial.repairs, **score_row(score))
            scored = True
            self._chart_one(where, score)
        return scored, unusable

    def _chart_one(self, where: str, score: Score) -> None:
        count = self._kinds()[score.kind]
        if not self.reference and count <= LEARN:
            print(f"monitor: {where}: kept to learn from", flush=True)
            if count == LEARN:
                self._learn()
            return
        before = self.chart.changed()
        self.chart.add(score)
        self.wheres.append(where)
        print(f"monitor: {trial_line(where, self.chart.trials[-1], self.chart, self.scorer.parameters)}", flush=True)
        if before is None:
            for line in self._alarm():
                print(f"monitor: {line}", flush=True)

    def _learn(self) -> None:
        """A kind has all its reference trials: the chart is another one."""
        before = outlier_lines(self.chart.baseline, self.scorer.parameters)
        self.chart, self.wheres = self._chart()
        for line in outlier_lines(self.chart.baseline, self.scorer.parameters):
            if line not in before:
                print(f"monitor: reference: {line}", flush=True)

    def _kinds(self) -> Counter[str]:
        """How many trials of each kind were scored."""
        return Counter(row["kind"] for row in self.history.rows if "slope" in row)

    def summary(self) -> str:
        """How many trials were judged and what came of it, and what is still learned, in one line."""
        kinds = self._kinds()
        learning = [f"{count} of {LEARN} {kind}" for kind, count in kinds.items() if count < LEARN]
        judged = f"{len(self.chart.trials)} of {kinds.total()} trials judged"
        state = "the arm has changed" if self.chart.changed() is not None else "no change is seen"
        return "; ".join([
            f"{judged}: {state}" if self.chart.trials else judged,
            *([f"learning: {', '.join(learning)}"] if learning and not self.reference else []),
        ])  # fmt: skip

    def _chart(self) -> tuple[Chart, list[str]]:
        """The chart of all trials so far, and their names."""
        reference, rest = list(self.reference), self.history.scores()
        if not reference:
            counts: Counter[str] = Counter()
            for _, score in rest:
                counts[score.kind] += 1
                if counts[score.kind] <= LEARN:
                    reference.append(score)
            learned = {id(score) for score in reference}
            whole = {kind for kind, count in counts.items() if count >= LEARN}
            reference = [score for score in reference if score.kind in whole]
            rest = [(row, score) for row, score in rest if id(score) not in learned]
        chart = chart_of(Baseline(reference), len(self.scorer.parameters))
        for _, score in rest:
            chart.add(score)
        return chart, [f"{row['session']}/{row['trial']}" for row, _ in rest]

    def _alarm(self) -> list[str]:
        """Lines about the change where the arm has changed; none where it has not."""
        if self.chart.changed() is None:
            return []
        attribution = attribute_change(self.chart.suspects(), self.chart.baseline, list(self.chart.lines))
        return change_lines(self.chart, attribution, self.scorer.parameters, self.wheres)

    def _write(self) -> None:
        from trunkline.report.figures.monitor import monitor_figure
        from trunkline.report.figures.style import save_figure  # pyplot takes long to import

        table = chart_table(self.chart, self.scorer.parameters, self.wheres)
        title = f"{self.folder.resolve().name}: {'the arm has changed' if self._alarm() else 'within limits'}"
        with output_folder(self.out / "new") as folder:
            table.to_csv(folder / "chart.csv", index=False, float_format="%.6g")
            save_figure(monitor_figure(table, title), folder / "chart.png")
        for name in ("chart.csv", "chart.png"):
            (self.out / "new" / name).replace(self.out / name)
        (self.out / "new").rmdir()


def scorer_of(model: Path, settings: Path) -> Scorer:
    """What scores trials against the MJCF at `model`, as the stage that wrote it compared them."""
    twin = Twin.load(model)
    arm, written = twin.arm.model, written_beside(twin, settings)
    params = read_yaml(settings / "params.yaml")
    stage = next((stage for stage in STAGES if stage in params), None)
    if stage is None:
        raise InputError(f"{settings / 'params.yaml'}: found no stage of identification, expected one of {STAGES}")
    loss = settings_of(stage, settings).loss
    return Scorer(arm, watched_in(arm), loss, written.frames, written.command_delay)


def reference_scores(
    reference: Path, scorer: Scorer, out: Path, made_of: dict, settings: Path
) -> tuple[list[Score], bool]:
    """Those of the trials of a session that may decide, scored once and kept beside the chart; whether only now.

    Raises:
        InputError: it is no session, or the model does not fit it.
    """
    files = sorted(file for file in reference.glob("*") if file.is_file())
    marks = [f"{file.name} {state.mark}" for file in files if (state := state_of(file)) is not None]
    history = History.opened(out / "reference.jsonl", made_of | {"reference": marks}, replace=True)
    if history.rows and history.rows[-1].get("last"):
        return [read_score(row) for row in history.rows], False
    trials = trials_of(reference, settings, "monitor", marker_places(scorer.model))
    trials = [trial for trial in trials if trial.split in DECIDING]
    check_trials(trials, scorer.model)
    with progress(len(trials), "monitor: reference", "trials") as bar:
        for number, trial in enumerate(trials, 1):
            score = scorer.score(trial)
            history.add(session=reference.name, trial=trial.name, last=number == len(trials), **score_row(score))
            bar.update(1, trial=trial.name)
    return [read_score(row) for row in history.rows], True
