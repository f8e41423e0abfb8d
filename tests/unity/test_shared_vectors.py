"""Shared vectors: a package's own core and network answer them, byte for byte, and they cover what there is."""

import json
import math

import numpy as np
import pytest
from pydantic import TypeAdapter

from tests.ar.teleop.test_core_faults import LINES
from tests.support.operator import config
from tests.unity.test_assemble import LABEL, TRAJECTORY, sources_in
from trunkline.ar.conformance.answers import answers_of
from trunkline.ar.conformance.vectors import FOLDER, STEPS, cases_file, steps_file, with_shared_vectors
from trunkline.ar.teleop.messages import Input, from_json
from trunkline.ar.teleop.settings import Teleop
from trunkline.ar.teleop.transitions import MODES, TRANSITIONS
from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import FixedMount
from trunkline.twin.package import package_digest, robot_of
from trunkline.unity.assemble import assemble
from trunkline.unity.readers import ENGINES, ENGINES_APART, refusals
from trunkline.unity.upm_package import NETWORK

CASES = ("alignment", "rigid_reach", "soft_reach", "targets", "network")
MOST = 1_500_000  # bytes of all, unpacked


@pytest.fixture(scope="module")
def recorded(files):
    """What steps.json says."""
    return json.loads(files[STEPS])


@pytest.fixture(scope="module")
def answers(files, recorded):
    """Those of the package, by the settings that its vectors name."""
    return answers_with(files, recorded)


def answers_with(files, recorded, **changes):
    settings = TypeAdapter(Teleop).validate_python(recorded["settings"] | changes)
    return answers_of(files, settings, recorded["mount_offset"])


def cases(files, name) -> list[tuple[dict, dict]]:
    return [(case["question"], case["answer"]) for case in json.loads(files[f"{FOLDER}/{name}.json"])["cases"]]


def test_the_core_answers_the_recorded_inputs_byte_for_byte(files, recorded, answers):
    nan = lambda dt: math.nan if dt is None else dt  # noqa: E731
    sequences = {
        sequence["name"]: [(nan(step["dt"]), from_json(Input, json.dumps(step["input"]))) for step in sequence["steps"]]
        for sequence in recorded["sequences"]
    }
    assert len(sequences) == len(recorded["sequences"])
    assert recorded["package"] == answers.core.package
    assert recorded["mount_offset"] == robot_of(files).mount_offset
    assert steps_file(answers.core, sequences) == files[STEPS]


@pytest.mark.parametrize("name", CASES)
def test_questions_are_answered_byte_for_byte(files, answers, name):
    assert cases_file(answers, name, [question for question, _ in cases(files, name)]) == files[f"{FOLDER}/{name}.json"]


def test_another_core_answers_otherwise(files, recorded, answers):
    """A client that errs is found out: here by one setting, by a millimetre of its mount, by a map's lattice."""
    for change in ({"look_back": 0.3}, {"moved": 0.0001}, {"delay": 0.6}):
        other = answers_with(files, recorded, **change)
        sequences = {
            sequence["name"]: [(step["dt"], from_json(Input, json.dumps(step["input"]))) for step in sequence["steps"]]
            for sequence in recorded["sequences"] if None not in [step["dt"] for step in sequence["steps"]]
        }  # fmt: skip
        assert (
            steps_file(other.core, sequences).partition(b"sequences")[2]
            != steps_file(answers.core, sequences).partition(b"sequences")[2]
        ), change


def test_every_mode_transition_and_fault_is_among_the_steps(recorded):
    sequences = {sequence["name"]: [step["intent"] for step in sequence["steps"]] for sequence in recorded["sequences"]}
    for (mode, event), after in TRANSITIONS.items():
        modes = [intent["mode"] for intent in sequences[f"{mode}, {event}"]]
        assert modes[-1] == after
        assert (mode, after) in zip(modes, modes[1:], strict=False)
    every = [intent for sequence in sequences.values() for intent in sequence]
    assert {intent["mode"] for intent in every} == set(MODES)
    notices = {intent["notice"] for intent in every}
    for fault, line in LINES.items():  # but for how long a client was silent: steps are longer here
        assert any(notice.startswith(line.partition(" 0.")[0] if fault == "silent" else line) for notice in notices), (
            fault
        )
    assert {intent["motion"] for intent in every} == {"hold", "execute", "follow"}


def test_steps_have_targets_of_every_kind_of_reach_under_several_gravities(recorded):
    (steps,) = (sequence["steps"] for sequence in recorded["sequences"] if sequence["name"] == "reach")
    targets = [step["intent"]["targets"] for step in steps if step["intent"]["targets"]]
    assert {target["tip"]["reach"] for target in targets} >= {"inside", "outside", "blocked"}
    assert {target["rigid"]["reach"] for target in targets} >= {"inside", "unknown"}
    tilts = np.degrees([math.acos(-target["pointing"][2]) for target in targets])
    assert len(set(np.round(tilts))) > 5
    assert any(target["tilt_limited"] for target in targets)


def test_look_ups_are_inside_outside_and_unknown_under_gravity_from_many_sides(files):
    for name in ("rigid_reach", "soft_reach"):
        places = [answer["where"] for _, answer in cases(files, name)]
        assert min(places.count("inside"), places.count("outside")) > 5
        assert "unknown" in places
    gravities = {tuple(np.round(question["gravity"], 6)) for question, _ in cases(files, "soft_reach")}
    assert len(gravities) > 10
    reach = [answer[end]["reach"] for _, answer in cases(files, "targets") for end in ("rigid", "tip")]
    assert set(reach) == {"inside", "outside", "unknown", "blocked"}


def test_half_planes_change_late(files):
    """On the way around, one is kept at which the other asks for less, by no more than the hysteresis."""
    turns = [(question["last"], answer["aligned"]) for question, answer in cases(files, "alignment")]
    late = [abs(new["turned"]) > math.pi / 2 + 1e-6 for last, new in turns if new["half_plane"] == last["half_plane"]]
    assert any(late)
    assert {new["half_plane"] for _, new in turns} == {0, 1}
    assert max(abs(new["turned"]) for _, new in turns) < math.pi  # the wrist's limits aside


def test_the_network_s_answers_are_those_of_every_engine(files):
    calls = cases(files, "network")
    poses = np.array([question["pose"] for question, _ in calls], dtype=np.float32)
    for answer in ENGINES.values():
        for name, values in zip(("commands", "lengths", "tip"), answer(files[NETWORK], poses), strict=True):
            expected = [outputs[name] for _, outputs in calls]
            np.testing.assert_allclose(values, expected, rtol=0, atol=2 * ENGINES_APART)
    assert any(outputs["doubtful"] for _, outputs in calls)


def test_vectors_are_small_and_part_of_the_package(files):
    paths = [STEPS, *(f"{FOLDER}/{name}.json" for name in CASES)]
    assert sum(len(files[path]) for path in paths) < MOST
    assert package_digest(files)
    assert all(f"{path}.meta" in files for path in paths)
    assert set(paths).isdisjoint(refusals(files))


def test_the_same_package_has_the_same_vectors(plain, plain_answered):
    assert with_shared_vectors(plain, config().core) == plain_answered
    assert with_shared_vectors(plain_answered, config().core) == plain_answered


def test_an_arm_on_a_mount_that_stands_still_has_none(tmp_path):
    made, _ = assemble(LABEL, sources_in(tmp_path), TRAJECTORY, FixedMount("fixed"))
    assert with_shared_vectors(made, config().core) == made
    assert robot_of(made) == FixedMount("fixed")


def test_maps_that_leave_nothing_within_reach_are_one_line(plain, monkeypatch):
    monkeypatch.setattr("trunkline.ar.conformance.questions.TRIES", 1)
    with pytest.raises(InputError, match="maps: found no mount and tip within reach in 1 tries, expected"):
        with_shared_vectors(plain, config().core)
