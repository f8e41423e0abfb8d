"""The gate: every way in which a metric can be bad fails, by name; nothing passes by being absent, or bit by bit.

Its baseline: test_baseline.py.
"""

import json
import math
from dataclasses import fields
from functools import cache
from pathlib import Path

import pytest

from tests.support.gated import GOOD, LIMITS, METRICS, changed, commit, gate_failures, made, renew, stored, write
from trunkline.errors import InputError
from trunkline.pipeline.stage import write_json
from upkeep import baseline, gate
from upkeep.limits import Limit, is_finite, limit_files, lookup, metrics_folder, read_limits

ROOT = Path(__file__).parents[2]


@pytest.fixture
def project(tmp_path):
    return made(tmp_path / "project")


def test_good_metrics_pass(project, capsys):
    assert gate_failures(project) == []
    assert gate.main(project) == 0
    assert "5 metrics in 1 stages, 0 problems" in capsys.readouterr().out


def test_metrics_that_no_row_names_are_let_alone(project):
    write(project, GOOD | {"new": 3, "unknown": None, "by": {"kind": [1.0]}})
    assert gate_failures(project) == []


def test_a_missing_file_fails(project, capsys):
    (project / "artifacts" / "fit" / "metrics.json").unlink()
    assert gate_failures(project) == ["fit: artifacts/fit/metrics.json is missing"]
    assert gate.main(project) == 1
    assert "gate: FAIL fit: artifacts/fit/metrics.json is missing" in capsys.readouterr().out


def test_a_file_that_is_not_json_fails(project):
    (project / "artifacts" / "fit" / "metrics.json").write_text('{"accuracy": 0.9')
    assert "not JSON" in gate_failures(project)[0]


@pytest.mark.parametrize(
    ("metrics", "problem"),
    [
        ({k: v for k, v in GOOD.items() if k != "accuracy"}, "accuracy: missing, expected a value"),
        ({**GOOD, "error": 3.0}, "error.validate: missing, expected a value"),
        ([1, 2], "error.validate: missing, expected a value"),
        (changed(accuracy=None), "accuracy: null, expected a value"),
        (changed(accuracy="0.95"), "accuracy: found '0.95', expected a finite number"),
        (changed(accuracy=True), "accuracy: found True, expected a finite number"),
        (changed(validate=2.5, cad=20.0), "error.validate: found 2.5, expected at most 2"),
        (changed(accuracy=0.85), "accuracy: found 0.85, expected at least 0.9"),
        (changed(watertight=False), "watertight: found False, expected True"),
        (changed(watertight=1), "watertight: found 1, expected True"),
        (changed(opset=16), "opset: found 16, expected 15"),
        (changed(cad=4.9), "error.validate: found 1, expected 5 times below error.cad, 4.9"),
        (changed(cad=None), "error.cad: found None"),
        (changed(validate=1.31), "error.validate: found 1.31, baseline 1, expected at most 1.3"),
        (changed(accuracy=0.93), "accuracy: found 0.93, baseline 0.95, expected at least 0.935"),
        (changed(spread=5.3), "spread: found 5.3, baseline 4, expected at most 5.2"),
    ],
)
def test_each_bad_value_fails_by_name(project, metrics, problem):
    write(project, metrics)
    assert any(problem in line for line in gate_failures(project)), gate_failures(project)
    assert gate.main(project) == 1


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("key", ["error.validate", "error.cad", "spread", "free.1"])
def test_a_number_that_is_not_finite_fails_under_whatever_key(project, key, value):
    last = key.rpartition(".")[2]
    write(project, changed(free=[1.0, value]) if last == "1" else changed(**{last: value}))
    assert gate_failures(project) == [f"fit: {key}: found {value}, expected a finite number"]
    assert gate.main(project) == 1


def test_a_little_worse_and_better_pass(project):
    write(project, changed(validate=1.29, accuracy=0.936, spread=5.1))
    assert gate_failures(project) == []
    write(project, changed(validate=0.2, accuracy=1.0, spread=0.0))
    assert gate_failures(project) == []


def test_many_commits_of_a_little_worse_fail_as_soon_as_they_sum_up(project):
    """15 commits of +9.9 %, each green beside the one before, took an error to four times its value."""
    refused = []
    for step in range(1, 16):
        write(project, changed(validate=1.099**step, cad=100.0))
        commit(project)
        if gate.main(project):
            refused.append(step)
    assert refused == list(range(3, 16))  # 1.099² = 1.21, 1.099³ = 1.33


def test_an_error_that_is_just_so_many_times_below_the_other_passes(project):
    write(project, changed(cad=5.0))
    assert gate_failures(project) == []


@pytest.mark.parametrize(
    ("value", "finite"),
    [(0, True), (-1.5, True), (math.nan, False), (math.inf, False), (-math.inf, False), (True, False), ("1", False),
     (None, False), ([1.0], False)],
)  # fmt: skip
def test_what_is_a_finite_number(value, finite):
    assert is_finite(value) is finite


def test_slack_counts_near_zero(project):
    write(project, changed(validate=0.001))
    commit(project)
    assert renew(project, "better") == 0
    write(project, changed(validate=0.0109))
    assert gate_failures(project) == []
    write(project, changed(validate=0.0112))
    assert gate_failures(project) == ["fit: error.validate: found 0.0112, baseline 0.001, expected at most 0.011"]


@pytest.mark.parametrize(
    ("limit", "before", "expected"),
    [
        ({"max": 9.0}, 2.0, 2.6),
        ({"max": 2.5}, 2.0, 2.5),
        ({"better": "lower", "factor": 2}, 2.0, 4.0),
        ({"better": "lower", "slack": 5}, 0, 5),
        ({"better": "lower"}, -1.0, -0.7),
        ({"min": 0.5}, 0.9, 0.87),
        ({"min": 0.88}, 0.9, 0.88),
        ({"better": "higher", "slack": 0.2}, 1.0, 0.8),
        ({"better": "higher"}, 1300, 1000),
        ({"better": "higher"}, 1.3, 1.0),
        ({"better": "higher"}, -1.0, -1.0 - 0.3 / 1.3),
        ({"better": "higher"}, 0.13, 0.1),  # not what is missing from 1, which would pass 0
        ({"better": "higher", "slack": 0.05}, 0.0, -0.05),
        ({"better": "lower", "goal": 1.5}, 1.7, 2.21),
        ({"better": "lower", "goal": 1.5}, 1.4, 1.5),
        ({"better": "higher", "goal": 0.95}, 0.95, 0.95),
    ],
)
def test_bounds_by_hand(limit, before, expected):
    assert Limit(**limit).bound(before) == pytest.approx(expected)


SHARES = "fit:\n  hold.rate: {min: 0.95, slack: 0.02, trials: {key: hold.runs, least: 200}}\n"


def share(successes, of, **more):
    return {"hold": {"rate": successes / of, "runs": of} | more}


@pytest.mark.parametrize(
    ("metrics", "problems"),
    [
        (share(196, 200), []),
        (share(190, 200), []),
        (share(189, 200), ["found 0.945, expected at least 0.95"]),  # whose interval ends at 97 %
        (share(199, 199), ["hold.runs: found 199, expected at least 200 trials"]),
        (share(10, 10), ["hold.runs: found 10, expected at least 200 trials"]),
        (share(196, 200, runs=None), ["hold.runs: found None, expected at least 200 trials"]),
        (share(196, 200, runs=True), ["hold.runs: found True, expected at least 200 trials"]),
        (share(196, 200, rate=None), ["null, expected a value"]),
    ],
)
def test_a_share_is_held_by_itself_and_must_be_of_enough_trials(tmp_path, metrics, problems):
    (tmp_path / "limits.yaml").write_text(SHARES)
    limit = read_limits(tmp_path / "limits.yaml")["fit"]["hold.rate"]
    assert limit.problems(metrics, "hold.rate", None) == problems


def test_a_share_is_held_to_the_baseline_within_its_slack():
    limit = Limit(min=0.5, slack=0.02)
    assert limit.problems(share(196, 200), "hold.rate", 1.0) == []
    (line,) = limit.problems(share(195, 200), "hold.rate", 1.0)
    assert line.endswith("baseline 1, expected at least 0.98")


@pytest.mark.parametrize(
    ("better", "goal", "before", "value", "problems"),
    [
        ("lower", 1.5, 1.7, 1.6, []),
        ("lower", 1.5, 1.7, 1.4, []),
        ("lower", 1.5, None, 9.0, []),
        ("lower", 1.5, 1.5, 1.51, ["found 1.51, expected at most 1.5"]),
        ("lower", 1.5, 1.0, 1.6, ["found 1.6, expected at most 1.5", "found 1.6, baseline 1, expected at most 1.3"]),
        ("higher", 0.95, 0.9, 0.91, []),
        ("higher", 0.95, 0.96, 0.94, ["found 0.94, expected at least 0.95"]),
    ],
)
def test_a_goal_that_is_missed_holds_once_the_baseline_meets_it(better, goal, before, value, problems):
    lines = Limit(better=better, goal=goal).problems({"a": value}, "a", before)
    assert [line for line in lines if "baseline" not in line or line in problems] == problems
    assert bool(lines) == bool(problems)


@pytest.mark.parametrize(
    ("metrics", "problems"),
    [
        ({"cover": {"share": 0.95, "stated": 0.95}}, []),
        ({"cover": {"share": 0.949, "stated": 0.95}}, ["found 0.949, expected at least cover.stated, 0.95"]),
        ({"cover": {"share": 1.0}}, ["cover.stated: found None, expected a finite number to compare with"]),
        ({"cover": {"share": 1.0, "stated": True}}, ["cover.stated: found True, expected a finite number"]),
    ],
)
def test_what_must_reach_another_metric_does(metrics, problems):
    lines = Limit(better="higher", reaches="cover.stated").problems(metrics, "cover.share", None)
    assert len(lines) == len(problems)
    assert all(line.startswith(problem) for line, problem in zip(lines, problems, strict=True))


def test_a_stage_that_never_ran_is_told_and_holds_nothing_until_it_did(project, capsys):
    """Its first baseline ends that: from then on it fails without its metrics."""
    (project / "tests" / "limits.yaml").write_text(LIMITS + "rare:\n  rate: {min: 0.5}\n")
    assert gate.main(project) == 0
    assert "gate: rare: never ran, its 1 rows hold nothing yet" in capsys.readouterr().out
    commit(project)
    assert renew(project, "of what ran") == 0
    file = project / "artifacts" / "rare" / "metrics.json"
    file.parent.mkdir()
    file.write_text('{"rate": 0.4}')
    assert gate_failures(project)[0].startswith("rare: rate: no baseline")
    assert gate_failures(project)[1] == "rare: rate: found 0.4, expected at least 0.5"
    file.write_text('{"rate": 0.6}')
    commit(project)
    assert renew(project, "it ran") == 0
    assert gate_failures(project) == []
    file.unlink()
    assert gate_failures(project) == ["rare: artifacts/rare/metrics.json is missing"]
    assert gate.main(project) == 1


def test_of_the_project_s_stages_only_the_rehearsal_may_not_have_run():
    """No baseline without a row of each other stage, or a stage's metrics could be deleted unseen."""
    for file in limit_files(ROOT):
        before = baseline.read_baseline(baseline.baseline_file(file))
        assert set(own_limits(file)) - set(before.metrics) <= {"rehearse"}


def test_a_row_without_a_baseline_fails_and_the_command_adds_it(project):
    (project / "tests" / "limits.yaml").write_text(LIMITS + "  error.cad: {better: lower}\n")
    assert gate_failures(project) == ['fit: error.cad: no baseline, expected one (`make baseline REASON="..."`)']
    commit(project)
    assert renew(project, "a new row") == 0
    assert gate_failures(project) == []
    assert stored(project)["metrics"]["fit"]["error.cad"] == 8.0


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ("", "limits.yaml: "),
        ("fit: {}", "limits.yaml: fit: "),
        ("fit:\n  a: {}", "limits.yaml: fit: a: found no bound, expected one of max, min, better, equals"),
        ("fit:\n  a: {max: 1, min: 0}", "limits.yaml: fit: a: found max and min, expected one of"),
        ("fit:\n  a: {maximum: 1}", "limits.yaml: fit: a.maximum: unknown key, did you mean"),
        ("fit:\n  a: {max: .nan}", "limits.yaml: fit: a.max: found nan, expected a finite number"),
        ("fit:\n  a: {min: -.inf}", "limits.yaml: fit: a.min: found -inf, expected a finite number"),
        ("fit:\n  a: {max: 1, slack: .inf}", "limits.yaml: fit: a.slack: found inf, expected a finite number"),
        ("fit:\n  a: {max: 1, factor: .nan}", "limits.yaml: fit: a.factor: found nan, expected a finite number"),
        ("fit:\n  a: {max: 1, factor: 100}", "limits.yaml: fit: a.factor: found 100, expected 1 to 3"),
        ("fit:\n  a: {max: 1, below: {key: b, factor: .inf}}", "limits.yaml: fit: a.below.factor: found inf"),
        ("fit:\n  a: {max: 1, below: {key: b, factor: 0.25}}", "limits.yaml: fit: a.below.factor: found 0.25"),
        ("fit:\n  a: {max: 1, below: {key: b, factor: 0.999}}", "limits.yaml: fit: a.below.factor: found 0.999"),
        ("fit:\n  a: {max: 1, goal: 0.5}", "limits.yaml: fit: a: found goal and max, expected a goal that is missed"),
        ("fit:\n  a: {better: lower, goal: .nan}", "limits.yaml: fit: a.goal: found nan, expected a finite number"),
        ("fit:\n  a: {min: 1, trials: {key: b, least: 0}}", "limits.yaml: fit: a.trials.least: found 0"),
        ("fit:\n  identified.test.a: {max: 1}", "limits.yaml: fit: identified.test.a: found a metric of `test`"),
        ("fit:\n  test: {max: 1}", "limits.yaml: fit: test: found a metric of `test`"),
        (
            "fit:\n  a: {max: 1, below: {key: null.test.a, factor: 1}}",
            "limits.yaml: fit: null.test.a: found a metric of `test`",
        ),
        ("fit:\n  a: {min: 1, reaches: b.test}", "limits.yaml: fit: b.test: found a metric of `test`"),
        ("fit:\n  a: {min: 1, trials: {key: test.n, least: 1}}", "limits.yaml: fit: test.n: found a metric of `test`"),
        ("score:\n  identified.late: {max: 1}", "limits.yaml: score: identified.late: found a metric of `test`"),
        ("- a", "limits.yaml: "),
    ],
)
def test_limits_that_hold_nothing_are_refused_in_one_line(project, capsys, limits, problem):
    (project / "tests" / "limits.yaml").write_text(limits)
    assert gate.main(project) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert problem in line


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"spread": 4.0', '"spread": NaN', "baseline.json: metrics: fit.spread: found nan, expected a finite number"),
        ('"spread": 4.0', '"spread": Infinity', "baseline.json: metrics: fit.spread: found inf, expected a finite"),
        ('"spread": 4.0', '"spread": null', "baseline.json: metrics: fit.spread: found None"),
        ('"the first"', '""', "baseline.json: changes: 0.reason: found ''"),
        ('"changes"', '"change"', "baseline.json: "),
        ('"hash"', '"hush"', "baseline.json: changes: 0.hash: missing"),
        ('"values"', '"value"', "baseline.json: changes: 0.values: missing"),
        ("{", "", "baseline.json: "),
    ],
)
def test_a_bad_baseline_is_refused_in_one_line(project, capsys, old, new, problem):
    file = project / "tests" / "baseline.json"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new, 1))
    assert gate.main(project) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert problem in line


@pytest.mark.parametrize("name", ["limits.yaml", "baseline.json"])
def test_a_missing_file_is_refused(project, name, capsys):
    (project / "tests" / name).unlink()
    assert gate.main(project) == 1
    assert f"{name}: no such file" in capsys.readouterr().err


# the project's own rows

own_limits = cache(read_limits)  # of a file that no test writes to
own_baseline = cache(baseline.read_baseline)


def own_rows():
    """File, stage, dotted key and limit of all rows of all limits."""
    for file in limit_files(ROOT):
        for stage, rows in own_limits(file).items():
            for key, limit in rows.items():
                yield file, stage, key, limit


def value_before(file, stage, key):
    return own_baseline(baseline.baseline_file(file)).metrics.get(stage, {}).get(key)


def broken_in(limit, before, metrics, key):
    """By clause of a row of a stage's `metrics`: what breaks that clause and no more than it has to, by dotted key,
    and words of the message about it."""
    value, worse = lookup(metrics, key), 1 if limit.rises else -1
    word = "at most" if limit.rises else "at least"

    def beyond(bound):
        return bound + worse * max(1e-6 * abs(bound), 1e-12)

    yield "missing", {key: ...}, "missing, expected a value"
    yield "null", {key: None}, "null, expected a value"
    if limit.equals is not None:
        other = not limit.equals if isinstance(limit.equals, bool) else limit.equals + 1
        yield "equals", {key: other}, f"found {other!r}, expected {limit.equals!r}"
        return
    near, goal = limit.near(before), limit.demanded(before)
    yield "no number", {key: "12"}, "found '12', expected a finite number"
    yield "baseline", {key: beyond(near)}, f"baseline {before:g}, expected {word} {near:g}"
    if goal is not None:
        yield "goal", {key: beyond(goal)}, f"expected {word} {goal:g}"
    if limit.below is not None:
        other, times = limit.below.key, f"expected {limit.below.factor:g} times below {limit.below.key}, "
        some = value or 1e-3  # nothing is below 0
        yield "below", {key: some, other: some * limit.below.factor * (1 - 1e-6)}, times
        yield "below's other", {other: None}, f"{other}: found None"
    if limit.reaches is not None:
        yield "reaches", {limit.reaches: value + 1e-6}, f"expected at least {limit.reaches}, "
        yield "reaches' other", {limit.reaches: None}, f"{limit.reaches}: found None"
    if limit.trials is not None:
        few, most = limit.trials.key, limit.trials.least - 1
        yield "trials", {few: most}, f"{few}: found {most}, expected at least {limit.trials.least} trials"


def put(metrics, changes):
    """A copy of nested mappings with these values by dotted key; `...` takes one away."""
    metrics = json.loads(json.dumps(metrics))
    for key, value in changes.items():
        *parts, last = key.split(".")
        holder = metrics
        for part in parts:
            holder = holder[part]
        if value is ...:
            del holder[last]
        else:
            holder[last] = value
    return metrics


def rows_with_values():
    for file, stage, key, limit in own_rows():
        if metrics_of(file, stage).exists() and (
            limit.equals is not None or value_before(file, stage, key) is not None
        ):
            yield pytest.param(file, stage, key, id=f"{metrics_folder(file).name}-{stage}-{key}")


def metrics_of(file, stage):
    return metrics_folder(file) / METRICS.format(stage)


@pytest.mark.parametrize(("file", "stage", "key"), list(rows_with_values()))
def test_each_row_can_fail(file, stage, key, tmp_path):
    """Each clause of each row, broken a little and written as a stage writes it, is refused by its own message."""
    limit, before, path = own_limits(file)[stage][key], value_before(file, stage, key), tmp_path / METRICS.format(stage)
    metrics = json.loads(metrics_of(file, stage).read_text())
    path.parent.mkdir(parents=True)
    for clause, changes, words in broken_in(limit, before, metrics, key):
        write_json(path, put(metrics, changes))
        lines = gate.failures({stage: {key: limit}}, own_baseline(baseline.baseline_file(file)), tmp_path)
        assert any(line.startswith(f"{stage}: {key}: ") and words in line for line in lines), (clause, lines)


def test_a_row_is_refused_by_every_clause_that_its_limit_has():
    """The test above breaks nothing that it does not know of."""
    assert {field.name for field in fields(Limit)} == {
        *("max", "min", "better", "equals", "goal", "factor", "slack"),  # baseline, goal
        *("below", "reaches", "trials"),
    }


def test_no_row_is_kept_from_failing_by_the_writer_or_a_number_that_is_not_finite(tmp_path):
    """The writer refuses one, by name; where another program wrote it, the gate does."""
    path = tmp_path / "artifacts" / "fit" / "metrics.json"
    path.parent.mkdir(parents=True)
    for file, stage, key, limit in own_rows():
        if limit.equals is not None or not metrics_of(file, stage).exists():
            continue
        last = key.rpartition(".")[2]
        with pytest.raises(InputError, match=f"{last}: found nan, expected a finite number"):
            write_json(path, {last: float("nan")})
        path.write_text(json.dumps({last: float("nan")}))
        (line,) = gate.failures({"fit": {last: limit}}, own_baseline(baseline.baseline_file(file)), tmp_path)
        assert line == f"fit: {last}: found nan, expected a finite number"


def test_each_row_has_a_baseline():
    """A row is there with its metric: what is missing here has to be run, then `make baseline`."""
    missing = [
        f"{metrics_folder(file).name}: {stage}: {key}"
        for file, stage, key, limit in own_rows()
        if limit.equals is None and value_before(file, stage, key) is None
    ]
    assert missing == []


SHARES_OF_1 = {"coverage", "share", "rate", "accuracy", "agreement", "brier", "tpr", "fpr", "rested", "doubted"}
SHARES_OF_1 |= {"gap_share", "filled_share", "within_1pct", "within_0p1pct", "beyond_force", "found_inside"}
SHARES_OF_1 |= {"found_outside", "heldout_iou_min", "heldout_reachable_min", "heldout_beyond_max"}
COUNTED = {"mujoco_rested": "mujoco_checked", "friction_band_found": "mujoco_checked"}
COUNTED |= {"beyond_1pct_unsaid": "targets"}  # a key beside it, or above


def most(metrics, key):
    """What a metric cannot be more than."""
    parts = key.split(".")
    if parts[-1] in SHARES_OF_1:
        return 1.0
    if parts[-1] in COUNTED:
        above = [".".join([*parts[:end], COUNTED[parts[-1]]]) for end in range(len(parts) - 1, -1, -1)]
        return next(count for name in above if (count := lookup(metrics, name)) is not None)
    return math.inf


def test_no_bound_lies_beyond_what_a_metric_can_be():
    """Or the row could not fail; a goal that is missed altogether may have such a bound, as it is shown."""
    for file, stage, key, limit in own_rows():
        before = value_before(file, stage, key)
        if before is None:
            continue
        bound = limit.bound(before)
        possible = bound < most(json.loads(metrics_of(file, stage).read_text()), key) if limit.rises else bound > 0
        assert possible or limit.goal is not None, f"{stage}: {key}: {bound:g}"
        assert abs(bound - before) <= max(abs(before), limit.slack) * (1 + 1e-9), f"{stage}: {key}: {bound:g}"


def test_no_row_rewards_a_smaller_radius_alone():
    """What is stated to hold the tip in so many cases is worth nothing where fewer do: a row of coverage beside it."""
    for file, stage, key, limit in own_rows():
        if "radius" in key:
            assert limit.better == "lower"
            rows, start = own_limits(file)[stage], key.rpartition("radius")[0] + "coverage."
            if beside := rows.get(f"{start}share"):
                assert beside.reaches is not None, f"{stage}: {key}"
                continue
            shares = [row for name, row in rows.items() if name.startswith(start) and name.endswith("share")]
            assert shares, f"{stage}: {key}"
            assert all(row.goal is not None for row in shares), f"{stage}: {key}"


def test_a_bound_is_an_input_error(tmp_path):
    (tmp_path / "limits.yaml").write_text("fit:\n  a: {max: .nan}")
    with pytest.raises(InputError, match="a.max: found nan"):
        read_limits(tmp_path / "limits.yaml")


def test_a_headline_of_another_code_fails(project, monkeypatch, capsys):
    """Which is: test_provenance.py."""
    monkeypatch.setattr(gate, "stale", lambda root: [f"README: rehearsal of {root.name}: of code abc"])
    assert gate.main(project) == 1
    out = capsys.readouterr().out
    assert "gate: FAIL README: rehearsal of project: of code abc" in out
    assert "5 metrics in 1 stages, 1 problems" in out
