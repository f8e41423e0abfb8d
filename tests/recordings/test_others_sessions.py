"""Sessions and models of others, each with one fault: what becomes of it is right, or a line that says what it is."""

import re

import pytest

from tests.support.folders import CASES, with_cases
from tests.support.outside import COMMON, OUTCOMES, outcome

pytestmark = with_cases

REPEATED = r"repaired: \d+ of \d+ frames repeat the one before to the last bit, .* poses are new at 50 Hz"
LATE = (
    r"(; repaired: (stamps|log times) are up to \d+ ms late, though frames come at [\d.]+ Hz: .* evened out by "
    r"{}; `even_times: false` leaves them)+"
)
COUNTED, NUMBERED = LATE.format("their count"), LATE.format("frame numbers")
EXPORTED = r"{}\.mcap: {} frames of 5 bodies, 100\.0 % seen"
UP_Y, UP_Z = r"up \[0\.0, 1\.0, 0\.0\]", r"up \[0\.0, 0\.0, 1\.0\]"
MOVED = r"site 'base_center': found it moved or turned, expected it in the world's origin and along its axes"
ALIKE = r"as in 00-honest: commands within 0\.\d mm, encoders within 0\.\d mm"
COMMANDS = r"as in 00-honest: commands within 0\.\d mm, no encoders"
TO_AND_FRO = r"commands jump to and fro \d+ times, by up to 20 mm, .*: do two publishers write to the topic\? .*"
STAMP_ZERO = (
    "works: 8 trials, 240 frames; repaired: the stamp of a message is a day or more from the others, such as 0 s of "
    "number 1, as if a clock was not set yet: left out"
)
RIGHT = {
    "00-honest": rf"works: 16 trials, 1118 frames; {ALIKE}; not a word",
    "00-honest-steps": r"works: 16 trials, 1298 frames; a command changes within 0 ms; not a word",
    "01-commands-on-change": r"works: 16 trials, 1298 frames; a command changes within 0 ms; not a word",
    "03-two-publishers-zeros-between": rf"pull_0\.mcap: trial pull_0: /tendon_commands: {TO_AND_FRO}",
    "05-one-topic-in-another-frame":
        r"refused: .*header.frame_id: found poses in the frames 'mocap' \(.*/base/pose.*\), 'world' \(.*/hand/pose\), "
        "expected all of them in one",
    "06-centimetres":
        r"works: 7 trials, 424 frames; hand 21 cm from the base; repaired: unit: bodies 20\.99 apart are no arm in m, "
        "as declared; taken as cm",
    "08-positions-turned-attitudes-not":
        r"refused: .*attitudes: .* turning positions to \(x, z, -y\) or .* leaves 2 %: expected positions and "
        "attitudes in one frame, right-handed",
    "09-left-handed": r"refused: .*at \[-3, 0, 30\] mm, at \[0, 0, -30\] mm as described: is the frame left-handed, .*",
    "11-each-pose-four-times": rf"works: 16 trials, 1118 frames; at 50 Hz(; {REPEATED})+",
    "12-advice-on-up-of-an-honest-session":
        r"`kp` of 5 times the described 800 N/m would fit better: .* mm off in place of .* mm, over 1 of the trials",
    "15-motive-z-up": rf"works: {EXPORTED.format('release_000', 100)}; .*; {UP_Z}; levels 0, 30, 45, 60; not a word",
    "16-motive-takes-of-one-name":
        r"refused: monday/Take_001\.csv: found friday/Take_001\.csv of the same name, and both would become "
        r"Take_001\.mcap, expected each take under a name of its own",
    "17-first-stamp-zero":
        rf"clock: stamp: {STAMP_ZERO}; clock: log: works: 8 trials, 248 frames.*; clock: frame: {STAMP_ZERO}",
    "21-messages-compressed-one-by-one":
        r"works: 4 trials, 124 frames; hand 21 cm from the base; repaired: /rigid_bodies: messages that are compressed "
        "one by one unpacked",
    "22-schema-without-definition":
        r"works: 4 trials, 124 frames; hand 21 cm from the base; repaired: /rigid_bodies: the schema .*/RigidBodies "
        "has no text in the log: read by its usual definition",
    "23-cdr2-encapsulation":
        r"refused: .*/rigid_bodies: found messages in the encapsulation CDR2, expected plain CDR, .*: set XCDR1 there",
    "24-marker-fields-of-before": r"works: 4 trials, 124 frames; markers 0, 1, 2, 3, 4; not a word",
    "26-json-zeros-left-out": r"works: 4 trials, 124 frames; base at \[0\.0, 0\.0, 0\.0\]; not a word",
    "27-one-message-per-motor": rf"works: 7 trials, 454 frames; {ALIKE}; .*some of 3 motors each put together",
    "29-joints-without-names": rf"works: 7 trials, 454 frames; {ALIKE}; not a word",
    "31-robot-joint-states-beside":
        rf"proposed topics: {{poses: /rigid_bodies, commands: /tendon_commands}}; works: 7 trials, 454 frames; "
        rf"{COMMANDS}; repaired: /joint_states left out as tendon position topic: found .*, none of a, b, c",
    "32-encoder-wraps":
        rf"works: 7 trials, 454 frames; {ALIKE}(; repaired: '[abc]': 2 jumps by a turn of an encoder that counts one "
        "turn taken out of what is measured){3}",
    "34-proposed-levels-of-curls":
        r"proposed levels 12, 10, 12, 0, 30, 45, 60; works: 7 trials, 514 frames; not a word",
    "35-motive-more-frames-in-header":
        rf"works: {EXPORTED.format('release_000', 100)}; .* found 100 frames, the header says 30100 \(Total Exported "
        rf"Frames\): is it all there\?; {UP_Y}",
    "36-motive-1-1-without-unit":
        r"refused: release_000\.csv: length units: found none in the header, expected `--unit`: meters, .*; "
        rf"with --unit meters: works: {EXPORTED.format('release_000', 100)}; {UP_Y}; hand 21 cm from the base",
    "37-vicon-nexus-csv":
        r"refused: trial\.csv: found no row that begins with Frame and Time: this is no export of Motive's, .*",
    "39-folder-per-bag": r"proposed levels 0, 30, 45, 60; works: 4 trials, 124 frames; not a word",
    "42-base-topic-in-another-frame":
        r"refused: .*header.frame_id: found poses in the frames 'world' \(.*/base/pose\), 'mocap' \(.*/hand/pose\), "
        "expected all of them in one",
    "47-motive-unlabelled-markers":
        rf"works: {EXPORTED.format('release_000', 100)}; .* 6 unlabelled markers left out; .*; {UP_Y}",
    "48-command-sent-before-recording":
        rf"works: 8 trials, 248 frames; {COMMANDS}; pull_0 12, -20, -20 mm; .*; repaired: commands end 7\.5 s before "
        "the poses: the last holds",
    "50-topic-per-motor":
        rf"works: 7 trials, 454 frames; {COMMANDS}; repaired: command messages that hold some of 3 motors each put "
        "together",
    "51-stamps-of-arrival":
        rf"works: 7 trials, 424 frames; at 50 Hz; filtered within [0-2] mm of what was measured{COUNTED}",
    "52-newer-and-older-mocap-messages": r"works: 2 trials, 62 frames; hand 21 cm from the base; not a word",
    "53-describe-models-of-others":
        r"cables_without_motors\.xml: .*found 0 actuators, expected 1; flexcomp\.xml: found a joint without a name .*; "
        r"no_base_center\.xml: found no body `base`, expected one: .*; no_tip_no_cables\.xml: found no site 'tip', "
        "expected one on the last unit",
    "54-mjcf-wind": r"x78_wind\.xml: model: option wind: found 8 0 0, expected 0 0 0: .* are solved without wind",
    "55-mjcf-messages":
        r"x07b_forcelimited_false\.xml: .*found forcelimited off, .*; x15_flag_gravity_off\.xml: .*found gravity "
        "disabled, expected enabled",
    "56-describe-takes-what-build-refuses":
        rf"x11_base_lifted\.xml: {MOVED}; x12_base_turned\.xml: {MOVED}; x70_no_names\.xml: found a joint without a "
        r"name \(number 1\), expected names for all; x81_damping_missing\.xml: .*: found no stiffness or no damping.*",
    "57-mjcf-parallel-hinges":
        r"x16c_axes_parallel\.xml: .*: found hinges about axes 0° apart, expected axes at right angles to each other",
    "59-bursts-in-the-log":
        rf"works: 7 trials, 424 frames; at 50 Hz; filtered within [0-2] mm of what was measured{NUMBERED}",
}  # fmt: skip


@pytest.mark.parametrize("case", RIGHT)
def test_what_becomes_of_a_case_is_right_or_said(case, tmp_path):
    words = outcome(case, tmp_path)
    assert re.fullmatch(RIGHT[case], words), words
    assert "by build_mjcf" not in words, "it takes what `describe` refuses, or the other way about"
    assert "\n" not in words


def test_every_case_is_tried():
    assert sorted(RIGHT) == sorted(OUTCOMES) == sorted({path.name for path in CASES.iterdir()} - {COMMON})
