"""From a binary input to the core's two controllers."""

import numpy as np

from trunkline.ar.session.alignment_procedure import ControllerPose
from trunkline.ar.session.binary import HAND, HANDS, Received
from trunkline.ar.teleop.input_validation import fault_of
from trunkline.ar.teleop.messages import Controller
from trunkline.ar.teleop.vectors import unit

PRESSED = 0.5
BUTTONS = ("trigger", "grip", "stick_pressed", "primary", "secondary")
NOWHERE = Controller((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), tracked=False)
STICK = HAND.index("stick_x")
_AT = {name: place for place, name in enumerate(HAND)}
_BUTTONS = [_AT[name] for name in BUTTONS]


def controllers(received: Received) -> tuple[Controller, Controller]:
    """Left and right. What is no number is left for the core to refuse by name."""
    left, right = (
        _controller(hand, {f"{name}_tracked", "visible"} <= received.flags)
        for name, hand in zip(("left", "right"), received.hands, strict=True)
    )
    return left, right


def stops(received: Received) -> bool:
    """Whether either secondary button is held, tracked or not."""
    return bool((received.hands[:, _AT["secondary"]] >= PRESSED).any())


def buttons(received: Received) -> bytes:
    """Which are held on either hand: other buttons, other bytes."""
    return (received.hands.take(_BUTTONS, axis=1) >= PRESSED).tobytes()


def controller_pose(received: Received, side: str) -> ControllerPose | None:
    """The pose of a hand's controller, None where it is not tracked or is no pose."""
    if not {f"{side}_tracked", "visible"} <= received.flags:
        return None
    x, y, z, a, b, c, d = (float(value) for value in received.hands[HANDS.index(side)][:7])
    controller = Controller((x, y, z), (a, b, c, d))
    return None if fault_of(controller) else ControllerPose(controller.position, unit(controller.quaternion))


def _controller(hand: np.ndarray, tracked: bool) -> Controller:
    x, y, z, a, b, c, d = (float(value) for value in hand[:7])
    stick_x, stick_y = (float(value) for value in hand[STICK : STICK + 2])
    pressed = {name: bool(hand[_AT[name]] >= PRESSED) for name in BUTTONS}
    return Controller((x, y, z), (a, b, c, d), tracked, stick=(stick_x, stick_y), **pressed)
