"""What the core remembers from step to step."""

from dataclasses import dataclass

from trunkline.ar.teleop.alignment import Aligned
from trunkline.ar.teleop.messages import Mode, Pose, Request, Targets, World
from trunkline.ar.teleop.tracked_controller import Hand
from trunkline.ar.teleop.vectors import DOWN, Vector


@dataclass(frozen=True)
class Pinned:
    """What a plan was asked for: any change of it voids the plan."""

    request: Request
    alignment: Pose
    world: World


@dataclass(frozen=True)
class TeleoperationState:
    """All that the core remembers from step to step.

    `silent`: s without a new stamp. `sound_for`: s for which all was sound and nothing pressed. `waited`: s in this
    mode. `world`: its digest. `history`: (stamp, targets) of the last while in it, to look back from a press and to
    follow with a delay.
    `digest`: of the plan that is there. `running`: the robot was seen to run it.
    """

    left: Hand
    right: Hand
    mode: Mode = "hold"
    stamp: float | None = None
    silent: float = 0.0
    sound_for: float = 0.0
    waited: float = 0.0
    pointing: Vector = DOWN
    limited: bool = False
    aligned: Aligned = Aligned(0.0, 0, 0.0)
    alignment: Pose | None = None
    world: str = ""
    history: tuple[tuple[float, Targets], ...] = ()
    serial: int = 0
    pinned: Pinned | None = None
    digest: str = ""
    running: bool = False
    following: Targets | None = None
    notice: str = ""

    @property
    def hands(self) -> tuple[Hand, Hand]:
        return self.left, self.right

    @property
    def pressed(self) -> set[str]:
        """Buttons that went down at this step, on either hand."""
        return {name for hand in self.hands for name in hand.pressed}

    @property
    def gripped(self) -> bool:
        """Whether a grip is held, without which the robot never moves."""
        return any(hand.grips for hand in self.hands)

    @property
    def idle(self) -> bool:
        """Whether all grips and triggers are let go."""
        return not any("grip" in hand.buttons or "trigger" in hand.buttons for hand in self.hands)

    def before(self, seconds: float) -> Targets | None:
        """The targets of so many `seconds` ago; None where there are none as old."""
        if self.stamp is None:
            return None
        return next((targets for stamp, targets in reversed(self.history) if stamp <= self.stamp - seconds), None)
