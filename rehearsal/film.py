"""A session that is filmed: what a picture shows of it, several times a second."""

from dataclasses import dataclass

import numpy as np

from rehearsal.robot.scene import SceneObject
from rehearsal.session import RATE, RehearsedSession
from trunkline.ar.hybrid.worlds import SupportSurface
from trunkline.frames import rotation_from_wxyz
from trunkline.kinematics.panda.kinematics import FLANGE, joint_frames

EVERY = 5  # frames of the session from shot to shot
SHOTS_PER_SECOND = RATE / EVERY


@dataclass
class Shot:
    """A moment of a run, in the Panda's true base frame, m.

    panda (9, 3): its base, its joints' frames and the flange. mount (3,). units (U, 3): centres of the arm's units;
    axes (U, 3): theirs; radii (U,). hands (2, 3), ends (2, 3): of the left and right ray, NaN where there is none.
    previewed (3,): where the shown plan's tip comes to rest, None where no plan is shown or run.
    centre (3,): of the object; turn (4,): its quaternion, w first. hook: from which it hangs, None if it does not.
    """

    now: float
    mode: str
    panda: np.ndarray
    mount: np.ndarray
    units: np.ndarray
    axes: np.ndarray
    radii: np.ndarray
    hands: np.ndarray
    ends: np.ndarray
    previewed: np.ndarray | None
    centre: np.ndarray
    turn: np.ndarray
    hook: np.ndarray | None
    object: SceneObject
    surfaces: list[SupportSurface]


def filmed(session: RehearsedSession) -> list[Shot]:
    """Of every fifth frame of a session that has not begun: filled as it goes on."""
    frame, shots, count = session.frame, [], 0

    def shot():
        nonlocal count
        view = frame()
        if count % EVERY == 0:
            shots.append(shoot(session, view.intent.mode))
        count += 1
        return view

    session.frame = shot
    return shots


def shoot(session: RehearsedSession, mode: str) -> Shot:
    """What is so now; what the client takes for the base frame is turned back into the true one."""
    robot, scene = session.robot, session.robot.scene
    truth, (units, axes) = robot.truth(), robot.links()
    grip = rotation_from_wxyz(truth.quaternion).apply(scene.object.grip)
    frames = joint_frames(robot.joints[:1])
    origins = [frame.p[:, 0] for frame in frames]
    flange = frames[-1].p[:, 0] + FLANGE * frames[-1].z[:, 0]
    ends = np.array([(np.nan,) * 3 if end is None else end for end in session.rays], dtype=float)
    hands = np.array([hand.turn.apply(hand.origin) + hand.shift for hand in session.hands])
    ghost = session.previewed if mode in ("preview", "ready", "delay", "execute") else None
    return Shot(
        session.now, mode, np.array([np.zeros(3), *origins, flange]), robot.base()[1], units, axes,
        np.array(robot.arm.chain.widths) / 2, _true(session, hands), _true(session, ends),
        None if ghost is None else _true(session, ghost), session.place(session.now) - grip, truth.quaternion,
        np.array(scene.hook) if truth.hanging and scene.hook is not None else None,
        scene.object, list(scene.surfaces.values()),
    )  # fmt: skip


def _true(session: RehearsedSession, places: np.ndarray) -> np.ndarray:
    """The inverse of `RehearsedSession.in_client_frame`."""
    instruments = session.robot.instruments
    return instruments.turn.inv().apply(places - instruments.shift)
