"""A certificate says what was found, refuses what does not belong together, and its page asks nothing of a network."""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from stages.report import CHECKOUT, code
from tests.report.certificate.sample import ASKED, INGESTED, sample, sample_trials, table, write
from tests.support.matched_plant import small_model, static_pull
from tests.support.twins import twin_of
from trunkline.errors import InputError
from trunkline.recordings.trials.conditions import Conditions
from trunkline.recordings.trials.splits import DECIDING, TEST, VALIDATE
from trunkline.report.certificate.budget import FRICTION, LACKING, NOISE
from trunkline.report.certificate.certificate import COMMAND, check_fitted, digest_of_code, inputs_of
from trunkline.report.certificate.facts import error_rows, parameter_facts
from trunkline.report.certificate.page import page
from trunkline.report.certificate.replays import LOST, UNIT
from trunkline.report.certificate.words import NOTHING, limits_of, next_step, open_lines, strong_pairs, verdict

IDENTIFIED = {"e_position_mm": 4.0, "e_position_pct": 0.8, "e_tip_mm": 9.0}


@pytest.fixture(scope="module")
def certificate():
    return sample()


@pytest.fixture(scope="module")
def html(tmp_path_factory):
    file = tmp_path_factory.mktemp("page") / "certificate.html"
    write(file)
    return file.read_text(encoding="utf-8")


def test_every_split_has_its_errors_beside_null_cad_and_noise_floor(certificate):
    rows = [row for row in certificate.facts["errors"] if row["kind"] is None]
    assert {row["split"] for row in rows} == {*DECIDING, TEST}
    for row in rows:
        assert {"identified", "CAD", "null: mean rest shape", "noise floor"} <= set(row["errors"])
        assert row["errors"]["noise floor"]["e_position_mm"] < row["errors"]["null: mean rest shape"]["e_position_mm"]


def test_the_verdict_is_of_the_trials_that_decided_nothing(certificate):
    good = certificate.facts["verdict"]["good_for"]
    assert f"({TEST})" in good
    (row,) = [r for r in certificate.facts["errors"] if r["split"] == TEST and r["kind"] is None]
    assert f"{row['errors']['identified']['e_position_mm']:.2g} mm" in good


@pytest.mark.parametrize(
    ("share", "null", "says"),
    [(0.8, 40.0, "previewing reaches. On some, markers are 4 mm off"), (2.5, 40.0, "showing how it moves. "),
     (5.0, 40.0, NOTHING), (0.8, 10.0, NOTHING)],
)  # fmt: skip
def test_what_it_is_good_for_follows_from_numbers(share, null, says):
    identified = IDENTIFIED | {"e_position_pct": share}
    rest = {"e_position_mm": null}
    lines = verdict("On some", identified, rest, ASKED.uses, ASKED.factor, 7.0, ["loads at the tip"], "do that.")
    assert lines["good_for"].startswith(says)
    assert lines["not_for"] == "what needs the tip nearer than 7 mm or loads at the tip."
    assert lines["next"] == "do that."


@pytest.mark.parametrize(
    ("source", "says"),
    [("mount_tilt_x", "record more static tilts"), (FRICTION, "reach each pose from the side"),
     (NOISE, "calibrate the cameras"), (LACKING, "record more trials at rest with split validate")],
)  # fmt: skip
def test_what_to_do_next_lowers_the_largest_line(source, says):
    rows = [{"source": name, "contribution_mm": 3.21 if name == source else 1.0}
            for name in ("mount_tilt_x", FRICTION, NOISE, LACKING)]  # fmt: skip
    sentence = next_step(rows, ["mount_tilt_x"])
    assert sentence.startswith(says)
    assert sentence.endswith(f": {source} adds the most to the tip's uncertainty, 3.2 mm.")


def test_what_it_is_not_good_for_is_what_no_trial_had(certificate):
    conditions = certificate.facts["uncertainty"]["conditions"]
    assert conditions["pull"] == pytest.approx(0.02)
    assert conditions["pulls"] == pytest.approx(0.02)
    assert conditions["tilt_deg"] == pytest.approx(60)
    limits = "loads at the tip, pulls above 20 mm at rest, pulls while the mount is tilted"
    assert limits in certificate.facts["verdict"]["not_for"]
    assert limits_of(Conditions(5.0, 0.0, 0.0, 0.0), [0.0, 0.05])[0] == "loads above 50 g"
    assert "a tilted mount" in limits_of(Conditions(5.0, 0.0, 0.0, 0.0), [])


def test_what_is_open_comes_with_the_experiments_that_would_tell_it():
    parameters = table(sample_trials(small_model(4))[:1])
    (line,) = open_lines(parameters)
    assert line.startswith("mount_tilt_y is not determined; told by static tilts")
    assert strong_pairs(parameters) == ["mount_tilt_x and mount_tilt_y rise together (+0.95)"]


def test_a_parameter_that_two_stages_identify_is_in_the_last_alone():
    first = table(sample_trials(small_model(4))[:1])
    last = first | {"parameters": {"mount_tilt_y": first["parameters"]["mount_tilt_y"] | {"value": 0.01}}}
    facts = parameter_facts({"identify_stiffness": first, "identify_damping": last})
    assert [list(section["parameters"]) for section in facts.values()] == [["mount_tilt_x"], ["mount_tilt_y"]]
    assert facts["identify_damping"]["parameters"]["mount_tilt_y"]["value"] == 0.01
    assert [facts[stage]["open"] != [] for stage in facts] == [False, True]
    assert facts["identify_stiffness"]["hardly_told_apart"] == []


def test_errors_of_the_shipped_model_come_first_and_an_intermediate_one_says_so():
    row = {"trials": 1, "e_position_mm": 1.0}
    metrics = {"identified": {DECIDING[1]: row | {"by_experiment": {"release": row}}}}
    rows = error_rows({"identify_stiffness": metrics, "identify_damping": metrics}, {})
    assert [(r["model"], r["shipped"]) for r in rows] == [
        ("identify_damping", True), ("identify_stiffness (intermediate model)", False)
    ]  # fmt: skip


def test_an_interval_that_ends_with_its_range_is_open():
    parameters = table(sample_trials(small_model(4))[:1])
    parameters["parameters"]["mount_tilt_x"]["interval_95_given_model"] = [-0.02, 0.1]
    first = open_lines(parameters)[0]
    assert first.startswith("mount_tilt_x is told to one side alone: its interval ends with its range;")


def test_the_held_out_trials_at_rest_tell_what_the_model_lacks(certificate):
    """Springs that are too stiff by so much make tips be off by a share of the way that gravity moves them."""
    truth = small_model(4)
    trials, accepted = sample_trials(truth), []
    for factor in (1.0, 1.1, 1.3):
        model = truth.__copy__()
        model.jnt_stiffness[:] *= factor
        inputs = inputs_of(twin_of(model), trials, INGESTED, 2, np.random.default_rng(0))
        assert inputs.lacking
        assert inputs.lacking.trials == 3
        accepted.append(inputs.lacking.rms[1])
    assert accepted[0] < 0.5 * accepted[1] < 0.25 * accepted[2] * 1.5
    assert certificate.metrics["open"] == 1


def test_too_few_held_out_trials_tell_nothing_and_the_page_says_so():
    trials = [trial for trial in sample_trials(small_model(4)) if trial.split != DECIDING[1]]
    assert inputs_of(twin_of(small_model(4)), trials, INGESTED, 2, np.random.default_rng(0)).lacking is None


def test_replays_are_the_trials_to_a_twentieth_of_a_millimetre(certificate):
    packed, trials = certificate.replays, sample_trials(small_model(4))
    numbers = np.frombuffer(base64.b64decode(packed["data"]), "<i2")
    names = [row["name"] for row in packed["trials"]]
    assert names == [trial.name for trial in trials]
    points = len(packed["radii_m"])
    assert points == len(trials[0].markers) + 1
    row, trial = packed["trials"][0], trials[0]
    first = numbers[row["offset"] : row["offset"] + 3 * points].reshape(points, 3) * UNIT
    np.testing.assert_allclose(first[1:], trial.positions[0], atol=UNIT)
    assert not first[0].any()
    hidden = [replace(trials[0], measured=np.arange(len(trial.markers))[None] > 0), *trials[1:]]
    lost = np.frombuffer(base64.b64decode(sample(trials=hidden).replays["data"]), "<i2")
    assert (lost == LOST).sum() == 3


def test_a_model_of_another_session_is_refused_in_one_line():
    trials = sample_trials(small_model(4))
    with pytest.raises(InputError, match="fitted to trial tilt_0_identify .* found no trial tilt_0_identify"):
        check_fitted({"identify_stiffness": table(trials)}, trials[1:])
    moved = replace(trials[0], positions=trials[0].positions + 1e-3)
    with pytest.raises(InputError, match="digest .* in data/processed/filter, expected the session"):
        check_fitted({"identify_stiffness": table(trials)}, [moved, *trials[1:]])


def test_a_model_of_another_arm_is_refused_in_one_line():
    with pytest.raises(InputError, match="session.yaml: markers: trial tilt_0_identify: found 'unit_04'"):
        sample(model=small_model(3), trials=None)


def test_the_code_has_one_digest_which_every_change_of_it_changes(tmp_path):
    (tmp_path / "rooms/__pycache__").mkdir(parents=True)
    (tmp_path / "stage.py").write_text("a")
    (tmp_path / "rooms/one.py").write_text("b")
    parts, digests = ["stage.py", "rooms"], set()
    digests.add(digest_of_code(tmp_path, parts))
    (tmp_path / "rooms/__pycache__/one.pyc").write_text("left by Python")
    assert {digest_of_code(tmp_path, parts[::-1])} == digests
    (tmp_path / "rooms/one.py").write_text("c")
    digests.add(digest_of_code(tmp_path, parts))
    (tmp_path / "rooms/one.py").rename(tmp_path / "rooms/two.py")
    digests.add(digest_of_code(tmp_path, parts))
    assert len(digests) == 3


def test_the_committed_certificate_names_the_committed_code():
    facts = json.loads((CHECKOUT / "artifacts/report/facts.json").read_text())
    assert facts["code"] == digest_of_code(CHECKOUT, code())


def test_the_page_stands_by_itself(html):
    assert not re.findall(r"""(?:src|href)=["'](?!data:)""", html)
    assert "default-src 'none'" in html
    assert html.count("<h1>") == 1
    assert "small arm &lt;of tests&gt;" in html
    assert "<of tests>" not in html
    replays = json.loads(re.search(r'id="replays">(.*?)</script>', html, re.DOTALL)[1])
    assert replays["trials"]
    for words in ("Errors", "Replay", "Parameters", "Uncertainty of the tip", "Data quality", COMMAND, "Signature",
                  "Good for", "Not for", "What to do next:", "given the model"):  # fmt: skip
        assert words in html, words
    assert len(html) < 15e6


def test_the_page_shows_an_interval_a_parameter_and_calls_it_what_it_is(certificate):
    """Of the first stage with what the model fixes, of the second given the model."""
    narrow = table(sample_trials(small_model(4))[:1])
    wide = {name: row | {"interval_95": [-0.0123, 0.0123]} for name, row in narrow["parameters"].items()}
    tables = {"identify_stiffness": narrow | {"parameters": wide}, "identify_damping": table_of("damping", narrow)}
    facts = certificate.facts | {"files": {}, "code": "", "parameters": parameter_facts(tables)}
    first, second = page(facts, {}, dict.fromkeys(("uncertainty", "poses"), b"")).split("<h3>identify_")[1:3]
    assert "95 % interval, with the model&#x27;s tolerances" in first
    assert "-0.0123 … 0.0123" in first
    assert "given the model" not in first
    assert "95 % interval, given the model" in second


def table_of(name: str, like: dict) -> dict:
    """A stage's table of one parameter."""
    return like | {"parameters": {name: like["parameters"]["mount_tilt_x"] | {"value": 0.01,
                   "interval_95_given_model": [0.005, 0.02], "range": [0.001, 1.0]}},
                   "correlation": {name: {name: 1.0}}}  # fmt: skip


def test_recorded_poses_move_the_tip_that_it_is_about_and_the_page_says_so():
    """Sixteen pulls in which the tip is seen 5 mm beside the twin's."""
    model = small_model(4)
    trials = sample_trials(model)
    for number in range(16):
        turn = number // 3  # further pulls of the same two motors, 3 mm from each other: no pose is repeated
        pulls = np.roll([0.0, 3.0 * (turn + 1), 20.0 - 3.0 * turn], number % 3).tolist()
        trial = static_pull(model, pulls, split=VALIDATE)
        positions = trial.positions.copy()
        positions[:, -1] += [0.005, 0.0, 0.0]
        trials.append(replace(trial, name=f"pose_{number:02}", positions=positions))
    plain, certificate = sample(), sample(model, trials)
    learnt = certificate.facts["uncertainty"]["residual_map"]
    assert learnt["poses"] == 19
    assert learnt["twin"] > 4 > 2 > learnt["left_out"]
    assert certificate.metrics["residual_map"] == learnt
    assert "residual_map" not in plain.facts["uncertainty"]
    assert plain.lacking.residual_map is None
    assert certificate.lacking.residual_map is not None
    facts = certificate.facts | {"files": {}, "code": ""}
    html = page(facts, certificate.replays, {"uncertainty": b"", "poses": b""})
    assert "A residual map from 19 of them moves the twin's tip" in html
