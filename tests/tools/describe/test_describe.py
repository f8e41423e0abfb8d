"""`trunkline describe`: an arm in words, before anything is recorded."""

import re
import subprocess
from dataclasses import replace
from types import SimpleNamespace

import pytest
import yaml

from stages.build_mjcf import main as build_main
from tests.model.arm.test_sections import ACTUATION, SOLVER, TWO, arm
from tests.support.folders import ROOT
from tests.support.forced_arm import forced_model
from trunkline.errors import InputError
from trunkline.model.arm.from_file import FromFile
from trunkline.model.arm.guide_holes import GuideHoles
from trunkline.model.arm.joints import Joints
from trunkline.model.arm.tendons import Tendon
from trunkline.recordings.session.session import Session
from trunkline.tools.describe.__main__ import main
from trunkline.tools.describe.drawing import read_drawing
from trunkline.tools.describe.words import doubt_lines, marker_lines, tendon_lines, unit_lines

LINKS = (ROOT / "conf/build_mjcf/mjcf/four_links.xml").read_text()


def session(kinds: list[str], **changes) -> Session:
    trials = [{"file": f"{kind}.mcap", "experiment": kind, "split": "identify"} for kind in kinds]
    trials = [trial | ({"level": 30} if trial["experiment"] == "static_tilt" else {}) for trial in trials]
    return Session.model_validate({"frame": {"up": [0, 0, 1]}, "base": "base", "trials": trials} | changes)


@pytest.fixture(scope="module")
def model():
    return arm().build(ACTUATION, SOLVER, ROOT).spec.compile()


def test_units_that_are_alike_share_a_line(model):
    assert unit_lines(model) == [
        "5 units, 160 mm, 260 g",
        "  units 1 to 2: 50 mm long, 30 mm wide, 100 g, 10 N m/rad, bends by 40° to each side",
        "  units 3 to 5: 20 mm long, 20 mm wide, 20 g, 4 N m/rad, bends by 40° to each side",
    ]


def test_a_load_at_the_tip_is_told_beside_the_arm_s_own_mass():
    loaded = arm(tip_load=0.12).build(ACTUATION, SOLVER, ROOT).spec.compile()
    assert unit_lines(loaded)[0] == "5 units, 160 mm, 260 g of their own and a load of 120 g at the tip: 380 g in all"


def test_tendons_are_told_with_their_moment_arms(model):
    first, second, third = tendon_lines(model)[1:]
    # a unit that bends by 1° about its hinge takes up 1° of the distance, in both units that it crosses
    assert "tendon_1: at 0.0°, 12 mm from the axis, ends at unit 2, 75.0 mm long, 0.419 mm for 1°" in first
    assert "tendon_2: at 90.0°, 12 to 8 mm from the axis, ends at unit 5" in second
    assert third.endswith("2000 N/m up to 50 N, 3 N at command 0")


def test_markers_beside_the_axis_are_told(model):
    assert marker_lines(model)[1:] == ["  tip: 170 mm from the mount, 5.39 mm aside"]


def test_what_no_log_will_tell_is_said():
    one_side = arm(tendons=[Tendon(0.0), Tendon(40.0), Tendon(-40.0)]).build(ACTUATION, SOLVER, ROOT).spec.compile()
    lines = doubt_lines(one_side, None)
    assert lines[0].startswith("masses are as described")
    assert lines[1] == "no tendon bends the arm towards -180°: neighbours are 280° apart"
    still = session(["static_path"], frame={"up": [0, 0, 1], "gravity": "none"}, markers={"marker": "unit_05"})
    text = "\n".join(doubt_lines(one_side, still))
    assert "tells joint_friction, damping, tendon_friction, friction_time, kv, time_constant" in text
    assert "stiffness and kp show in their ratio alone" in text
    assert "one tracked point" in text
    whole = doubt_lines(one_side, session(["static_tilt", "release", "motion"]))
    assert not any("tells" in line and "no trial" in line for line in whole)


def test_units_of_motors_are_compared_where_a_session_has_any():
    forced, note = forced_model(), "session.yaml: motors: commands are in m, the arm takes N"
    assert note not in doubt_lines(forced, session(["static_tilt"]))
    lengths = {"motors": {"m1": {"unit": "m", "tendons": {"tendon_1": 1}}}}
    assert note in doubt_lines(forced, session(["static_pull"], **lengths))


def test_names_that_the_arm_has_not_are_noted(model):
    named = {"motors": {"m1": {"unit": "m", "tendons": {"tendon_1": 1, "tendon2": -1}}}, "markers": {"a": "middle"}}
    lines = doubt_lines(model, session(["motion"], **named))
    assert "session.yaml: motors: found 'tendon2', the arm has tendon_1, tendon_2, tendon_3" in lines
    assert any("found 'base'" in line for line in doubt_lines(model, session(["motion"], markers={"a": "base"})))
    assert any(line.startswith("session.yaml: markers: found 'middle', the arm has unit_01,") for line in lines)


def test_what_is_hardly_meant_is_noted():
    heavy = replace(TWO[1], mass=60.0)
    tendons = [Tendon(0.0, 0.012), Tendon(120.0, pretension=80.0), Tendon(-120.0)]
    model = arm(sections=[TWO[0], heavy], tendons=tendons).build(ACTUATION, SOLVER, ROOT).spec.compile()
    assert doubt_lines(model, None)[:3] == [
        "unit 3 (and 2 more) has 3.18e+06 kg/m³, more than lead: is its mass in kg, its width in m?",
        "tendon_1 runs outside unit 3, 20 mm wide: 12 mm from the axis",
        "tendon_2 is to hold 80 N at command 0, its motor holds 50 N at most",
    ]


RADIANS = "are ranges in radians, and read as degrees? Expected the unit of compiler.angle"
DEGREES = "are ranges in degrees, and read as radians? Expected the unit of compiler.angle"


@pytest.mark.parametrize(
    ("angle", "range_", "note"),
    [
        ("degree", "-0.7 0.7", f"range: no joint bends by more than 0.7°, all together by 2.8°: {RADIANS}"),
        ("degree", "-0.1 1.9", f"range: no joint bends by more than 1.9°, all together by 7.6°: {RADIANS}"),
        ("degree", "-2.1 2.1", None),
        ("radian", "-0.7 0.7", None),
        ("radian", "-40 40", f"range: 'shoulder_pitch' bends by 2.29e+03°: {DEGREES}"),
    ],
)
def test_ranges_in_another_unit_are_noted(tmp_path, angle, range_, note):
    path = tmp_path / "links.xml"
    text = LINKS.replace('angle="degree"', f'angle="{angle}"')
    path.write_text(text.replace('range="-40 40"', f'range="{range_}"'))
    assert [line for line in doubt_lines(read_drawing(path, ROOT), None) if "range" in line] == ([note] if note else [])


def test_many_joints_that_bend_by_little_are_honest():
    def noted(units):
        slender = [replace(TWO[0], length=0.5, units=units)]
        tendons = [Tendon(0.0), Tendon(120.0), Tendon(-120.0)]
        described = arm(sections=slender, joint_range_deg=1.9, tendons=tendons, markers={})
        model = described.build(ACTUATION, SOLVER, ROOT).spec.compile()
        return any("radians" in line for line in doubt_lines(model, None))

    assert (noted(40), noted(50)) == (True, False)


def test_the_command_describes_a_file_and_draws_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([str(ROOT / "conf/build_mjcf/arm/ftdcr.yaml")]) == 0
    output = capsys.readouterr().out
    assert "15 units, 186.5 mm" in output
    assert "tendon_9: at -122.5°" in output
    assert "drawn in artifacts/describe/ftdcr.png" in output
    assert (tmp_path / "artifacts/describe/ftdcr.png").stat().st_size > 10_000
    ignored = ["git", "check-ignore", "-q"]
    for folder in (".", "examples/pairs"):
        assert subprocess.run([*ignored, f"{folder}/artifacts/describe/ftdcr.png"], cwd=ROOT).returncode == 0
    assert main([str(ROOT / "conf/build_mjcf/arm/ftdcr.yaml"), "--out", "mine.png"]) == 0
    assert (tmp_path / "mine.png").is_file()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tendons": [{"angle": 0, "distanse": 0.01}]}, "distanse: unknown key"),
        ({"sections": []}, "arm.sections: "),
        ({"kind": "cone"}, "arm: "),
    ],
)
def test_a_mistake_in_a_description_is_one_line(tmp_path, capsys, change, message):
    described = yaml.safe_load((ROOT / "conf/build_mjcf/arm/ftdcr.yaml").read_text()) | change
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(described))
    assert main([str(path)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error
    assert error.count("\n") == 1


def test_another_file_is_refused(tmp_path, capsys):
    assert main([str(tmp_path / "arm.stl")]) == 1
    assert "expected an arm's description, .yaml, or a model in MJCF, .xml" in capsys.readouterr().err


def test_keys_that_an_arm_lacks_are_told_at_once(tmp_path):
    lacking = tmp_path / "mine.yaml"
    lacking.write_text("kind: sections\nsections: [{length: 0.1, units: 2, width: 0.04, bending_stiffness: 0.05}]\n")
    with pytest.raises(InputError) as caught:
        read_drawing(lacking, ROOT)
    message = str(caught.value)
    assert "missing, expected a value; also missing: " in message
    for key in ("joint_range_deg", "damping_ratio", "tendons", "hole_ratio", "tip_load", "markers", "mass"):
        assert key in message


FAULTS = {
    "wind": ("<option ", '<option density="1.2" wind="8 0 0" ', "option wind: found 8 0 0, expected 0 0 0"),
    "gravity off": ("<worldbody>", '<option><flag gravity="disable"/></option><worldbody>', "found gravity disabled"),
    "parallel hinges": ('axis="0 1 0"', 'axis="1 0 0"', "expected axes at right angles to each other"),
    "slanted hinges": ('axis="0 1 0"', 'axis="0.5 1 0"', "found hinges about axes 63.4° apart"),
    "no limit of force": ("forcerange", 'forcelimited="false" forcerange', "found forcelimited off"),
    "no tip": ('name="tip"', 'name="end"', "found no site 'tip', expected one on the last unit"),
    "no mount": ('name="base_center"', 'name="mount_center"', "found no site 'base_center', expected one in the mount"),
    "no damping": ('damping="0.01"', 'damping="0"', "found no stiffness or no damping"),
    "base lifted": ('<body name="base"', '<body name="base" pos="0 0 1"', "'base_center': found it moved or turned"),
}


OF_HINGES = [fault for fault in FAULTS if fault != "no limit of force"]


@pytest.mark.parametrize(
    ("fault", "cables"), [*((fault, True) for fault in FAULTS), *((fault, False) for fault in OF_HINGES)]
)
def test_a_model_is_refused_as_by_build_mjcf_in_one_line(tmp_path, monkeypatch, capsys, fault, cables):
    old, new, message = FAULTS[fault]
    text = LINKS if cables else re.sub(r"<(tendon|actuator)>.*</\1>", "", LINKS, flags=re.DOTALL)
    assert old in text
    text = text.replace(old, new)
    path = tmp_path / "conf/build_mjcf/mjcf/links.xml"
    path.parent.mkdir(parents=True)
    path.write_text(text)
    monkeypatch.chdir(tmp_path)
    assert main([str(path)]) == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line
    with pytest.raises(InputError, match=re.escape(message)):
        build_main(SimpleNamespace(arm=FromFile("mjcf", "links.xml"), joints=Joints(), holes=GuideHoles(),
                                   actuation=ACTUATION, solver=SOLVER))  # fmt: skip


def test_cables_without_motors_and_a_file_that_is_not_there_are_one_line(tmp_path, capsys):
    path = tmp_path / "links.xml"
    path.write_text(re.sub(r"<actuator>.*</actuator>", "", LINKS, flags=re.DOTALL))
    assert main([str(path)]) == 1
    assert "found 0 actuators, expected 1" in capsys.readouterr().err
    assert main([str(tmp_path / "nope.xml")]) == 1
    assert capsys.readouterr().err.endswith("nope.xml: no such file, expected a model in MJCF\n")
