"""One hand: its controller's pose as filtered, its ray, and which buttons it has pressed since the step before."""

from dataclasses import dataclass, replace

from trunkline.ar.teleop.messages import Controller, Pose, Vector
from trunkline.ar.teleop.one_euro import Smoothed, smooth
from trunkline.ar.teleop.settings import RaySettings, Teleop
from trunkline.ar.teleop.vectors import Quaternion, add, multiply, rotate, scale

AHEAD = (0.0, 0.0, -1.0)  # of a controller's pose: along its ray
BELOW = (0.0, -1.0, 0.0)  # of a controller's pose: down, where it is held level
BUTTONS = ("trigger", "grip", "stick_pressed", "primary", "secondary")


@dataclass(frozen=True)
class Hand:
    """What a hand was at the step before.

    `controller`: its controller as last heard, tracked and finite. `lost_for`: s since then. `length`: of the ray, m.
    `target`: where it stays, base frame, m; None until a grip has set it. `gripped_at`: end of the ray when the grip
    was pressed, of a press since a plan was asked for. `pressed`: buttons that went down at this step. `buttons`: the
    buttons that are down.
    """

    length: float
    controller: Controller | None = None
    pose: Smoothed | None = None
    lost_for: float = 0.0
    target: Vector | None = None
    gripped_at: Vector | None = None
    buttons: tuple[str, ...] = ()
    pressed: tuple[str, ...] = ()

    @property
    def grips(self) -> bool:
        return "grip" in self.buttons


def hear(hand: Hand, controller: Controller, sample: float, settings: Teleop) -> Hand:
    """The hand after a sound `controller`, `sample` s after the one before.

    Buttons held when a controller appears are not presses: a press is what was seen to go down.
    """
    pose = smooth(
        hand.pose,
        controller.position,
        controller.quaternion,
        sample,
        settings.position_filter,
        settings.orientation_filter,
    )
    buttons = tuple(name for name in BUTTONS if getattr(controller, name))
    pressed = () if hand.controller is None else tuple(name for name in buttons if name not in hand.buttons)
    length = ray_length(hand.length, controller.stick[1], sample, settings.rays)
    return replace(
        hand, controller=controller, pose=pose, lost_for=0.0, length=length, buttons=buttons, pressed=pressed
    )


def missed(hand: Hand, dt: float, grace: float) -> Hand:
    """The hand where its controller was not heard for another `dt` s; beyond `grace` s, it holds nothing any more."""
    lost = hand.lost_for + dt
    if lost <= grace:
        return replace(hand, lost_for=lost, pressed=())
    return replace(hand, lost_for=lost, pressed=(), buttons=(), controller=None, pose=None, gripped_at=None)


def ray_length(length: float, stick: float, dt: float, rays: RaySettings) -> float:
    """The length, m, after `dt` s of the stick's deflection, -1 (in) to 1 (out); it ends at both limits."""
    if abs(stick) <= rays.dead_zone:
        return length
    share = (abs(stick) - rays.dead_zone) / (1 - rays.dead_zone)
    change = rays.rate * min(share, 1.0) * dt
    return min(max(length + (change if stick > 0 else -change), rays.shortest), rays.longest)


def ray_end(hand: Hand, alignment: Pose) -> Vector | None:
    """End of the ray in the base frame, m."""
    if hand.pose is None:
        return None
    reach = add(hand.pose.position, scale(rotate(hand.pose.quaternion, AHEAD), hand.length))
    return add(alignment.position, rotate(alignment.quaternion, reach))


def below(hand: Hand, alignment: Pose) -> Vector | None:
    """The controller's own downward direction in the base frame, to which the end effector is aligned."""
    if hand.pose is None:
        return None
    turn: Quaternion = multiply(alignment.quaternion, hand.pose.quaternion)
    return rotate(turn, BELOW)
