"""Shared vectors: what the core of teleoperation, its parts and the network answer, for clients in other languages.

`steps.json` has sequences of inputs from the core's start, each with the intent that followed. Each other file has
cases of one function: questions, their names those of its arguments, and answers. All is made from the package's own
files, as a client reads them, and from one seed. Messages are those of `trunkline/ar/teleop/messages.py`; frames and
units are the core's, none of them Unity's. What is not finite is null.
"""

import json
from collections.abc import Iterable

import numpy as np
from pydantic import TypeAdapter

from trunkline.ar.conformance.answers import Answers, Case, answers_of
from trunkline.ar.conformance.questions import cases, within_reach
from trunkline.ar.conformance.sequences import sequences
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Input, Joints, to_json
from trunkline.ar.teleop.settings import Teleop
from trunkline.kinematics.panda.mounts import PandaRobot
from trunkline.twin.package import MANIFEST, robot_of
from trunkline.unity.assemble import sealed
from trunkline.unity.manifest import Manifest
from trunkline.unity.upm_package import without_metas

FOLDER = "Tests/Vectors"
STEPS = f"{FOLDER}/steps.json"
TELEOPERATION = "Runtime/teleoperation.json"
SEED = 0
SETTINGS = TypeAdapter(Teleop)


def with_shared_vectors(files: dict[str, bytes], core: Teleop) -> dict[str, bytes]:
    """A package with the settings of the core, and its shared vectors made with them; without both where a mount stands
    still, as nothing is teleoperated then.

    Raises:
        InputError: its maps leave nothing within reach.
    """
    robot = robot_of(files)
    if not isinstance(robot, PandaRobot):
        return files
    answers, rng = answers_of(files, core, robot.mount_offset), np.random.default_rng(SEED)
    joints: Joints = tuple(float(angle) for angle in robot.ready)  # type: ignore[assignment]
    rigid, tip = within_reach(answers, joints, rng)
    vectors = {TELEOPERATION: SETTINGS.dump_json(core, indent=2) + b"\n"}
    vectors[STEPS] = steps_file(answers.core, sequences(answers.core, joints, rigid, tip))
    for name, questions in cases(answers, joints, rigid, tip, rng).items():
        vectors[f"{FOLDER}/{name}.json"] = cases_file(answers, name, questions)
    return sealed(Manifest.model_validate_json(files[MANIFEST]), without_metas(files) | vectors)


def vectors(files: dict[str, bytes]) -> int:
    """How many shared vectors a package has: answers that a client is held to."""
    documents = [json.loads(data) for path, data in files.items() if path.startswith(FOLDER) and path.endswith(".json")]
    steps = sum(len(sequence["steps"]) for document in documents for sequence in document.get("sequences", []))
    return steps + sum(len(document.get("cases", [])) for document in documents)


def steps_file(core: Teleoperation, recorded: dict[str, list[tuple[float, Input]]]) -> bytes:
    """Sequences of inputs, with the time of each step, s, and the intents that follow from the core's start."""
    sequences = []
    for name, steps in recorded.items():
        state, lines = core.start(), []
        for dt, message in steps:
            state, intent = core.step(state, message, dt)
            lines.append(b'{"dt":%b,"input":%b,"intent":%b}' % (_json(dt), to_json(message), to_json(intent)))
        sequences.append(b'{"name":%b,"steps":%b}' % (_json(name), _lines(lines)))
    head = b'"settings":%b,"package":%b,"mount_offset":%b' % (
        SETTINGS.dump_json(core.settings), _json(core.package), _json(core.mount_offset),
    )  # fmt: skip
    return b'{%b,"sequences":%b}\n' % (head, _lines(sequences))


def cases_file(answers: Answers, name: str, questions: list[Case]) -> bytes:
    """Questions that `answers` answers by this name, each with its answer."""
    answer = getattr(answers, name)
    lines = (b'{"question":%b,"answer":%b}' % (_json(question), _json(answer(**question))) for question in questions)
    return b'{"cases":%b}\n' % _lines(lines)


def _lines(values: Iterable[bytes]) -> bytes:
    """A list in JSON, a value a line."""
    return b"[\n" + b",\n".join(values) + b"\n]"


def _json(value: object) -> bytes:
    """As short as it can be, what is not a number null."""
    return b"null" if value != value else json.dumps(value, separators=(",", ":"), allow_nan=False).encode()
