"""The core of teleoperation: one pure function from what is heard to what is wanted.

`Teleoperation.step(state, input, dt)` has no clock, threads or sockets; the same inputs give the same intents, byte
for byte. It decides; it does not move anything: planning, preview and motion are done outside and reported in the next
input.
"""

import math
from dataclasses import dataclass, replace

from trunkline.ar.teleop.alignment import Aligned, wrist_of
from trunkline.ar.teleop.client_silence import silence_reason
from trunkline.ar.teleop.events import Ends, detect_events, looked_back, stopped_by
from trunkline.ar.teleop.input_validation import clock_fault, fault_of, setting_fault, swapped
from trunkline.ar.teleop.messages import Input, Intent, Motion, Pose, Request, Targets
from trunkline.ar.teleop.reach import Reach
from trunkline.ar.teleop.settings import Teleop
from trunkline.ar.teleop.state import Pinned, TeleoperationState
from trunkline.ar.teleop.targets import bring, offered, out_of_reach, place, tilted, why_not
from trunkline.ar.teleop.tracked_controller import Hand, below, hear, missed, ray_end
from trunkline.ar.teleop.transitions import TRANSITIONS, Event, first_event
from trunkline.ar.teleop.vectors import Vector

AIMING = ("aim", "follow")
STAYS = "the robot stays at the last within reach"  # noticed while targets are not followed
GOES = "the robot goes to the nearest point within"  # noticed while it follows what is offered in their place
WATCHING = ("plan", "preview", "ready")  # nothing moves: a plan outlives that its user is not heard for a while
PLANNED = ("plan", "preview", "ready", "delay", "execute", "follow")  # modes that a change of the world concerns


@dataclass(frozen=True)
class Teleoperation:
    """The core for one package, named by its digest: settings, what can be reached, and how far the mount is from the
    flange, m."""

    settings: Teleop
    reach: Reach
    package: str
    mount_offset: float

    def start(self) -> TeleoperationState:
        """Before the first input: the robot holds."""
        hand = Hand(self.settings.rays.start)
        return TeleoperationState(hand, hand)

    def step(self, state: TeleoperationState, message: Input, dt: float) -> tuple[TeleoperationState, Intent]:
        """The state after `message`, and what is wanted now.

        Args:
            dt: s since the step before, of the caller's clock; stamps are of the client's.
        """
        state, lost, unheard = self._hands_after(state, message, dt)
        alignment = message.alignment
        if unheard and state.mode not in WATCHING:
            lost = lost or unheard
        if lost or alignment is None:
            events: dict[Event, bool] = {"lost": True, "stop": stopped_by(message)}
            return self._after(state, message, events, lost, None, dt, (None, None))
        if state.alignment != alignment:  # what is parked in the base frame is elsewhere in the room now
            left, right = (replace(hand, target=None) for hand in state.hands)
            state = replace(state, alignment=alignment, left=left, right=right, history=())
        if state.world != message.world.digest:  # what was judged before was judged in another world
            state = replace(state, world=message.world.digest, history=())
        ends = (ray_end(state.left, alignment), ray_end(state.right, alignment))
        state = self._parked(state, ends, alignment, dt)
        targets, beyond = self._targets(state, message), ""
        if state.mode == "follow" and targets is not None:
            targets, beyond = self._nearest(state, message, targets)
        if targets is not None:
            state = self._remembered(state, targets)
        events, notice = detect_events(state, message, targets, ends, self.settings)
        events["confirm"] = events["confirm"] and not unheard
        state, intent = self._after(state, message, events, notice, targets, dt, ends)
        return state, replace(intent, notice=unheard or (beyond if intent.mode == "follow" else "") or intent.notice)

    def _hands_after(self, state: TeleoperationState, message: Input, dt: float) -> tuple[TeleoperationState, str, str]:
        """Both hands after this input; why nothing of it can be trusted; and who is not heard. Either is "" where
        nothing is wrong, and else the robot must hold."""
        same = message.stamp == state.stamp
        silent = state.silent + dt if same and math.isfinite(dt) else 0.0
        fault = clock_fault(state.stamp, message, dt)
        quiet = "" if fault else silence_reason(state.stamp, message.stamp, silent, self.settings.safety)
        if fault or quiet:
            left, right = (missed(hand, math.inf, 0.0) for hand in state.hands)
            stamp = message.stamp if math.isfinite(message.stamp) else state.stamp  # from which time counts anew
            state = replace(state, left=left, right=right, stamp=stamp, silent=silent, history=())
            return state, fault or setting_fault(message, self.package), quiet
        if same:
            left, right = (replace(hand, pressed=()) for hand in state.hands)
            return replace(state, left=left, right=right, silent=silent), setting_fault(message, self.package), ""
        sample = dt if state.stamp is None else message.stamp - state.stamp
        hands, unseen = [], []
        for name, hand, controller in (("left", state.left, message.left), ("right", state.right, message.right)):
            wrong = fault_of(controller)
            if not wrong:
                hands.append(hear(hand, controller, sample, self.settings))
                continue
            hands.append(missed(hand, sample, self.settings.safety.grace))
            if hands[-1].controller is None:
                unseen.append(f"{name} controller: {wrong}; holding")
        sound = not fault_of(message.left) and not fault_of(message.right)
        if sound and swapped(state.left, state.right, message, self.settings.safety.swap):
            hands = [missed(hand, math.inf, 0.0) for hand in hands]
            fault = "controllers have changed places; holding until both grips are let go"
        left, right = hands
        state = replace(state, left=left, right=right, stamp=message.stamp, silent=0.0)
        return state, setting_fault(message, self.package) or fault, unseen[0] if unseen else ""

    def _parked(self, state: TeleoperationState, ends: Ends, alignment: Pose, dt: float) -> TeleoperationState:
        """Targets that are held by their grips moved to the ends of their rays; the others stay where they are."""
        hands, pointing, limited = list(state.hands), state.pointing, state.limited
        for index, (hand, end) in enumerate(zip(state.hands, ends, strict=True)):
            if state.mode not in AIMING:
                at = end if "grip" in hand.pressed else hand.gripped_at if hand.grips else None
                hands[index] = replace(hand, gripped_at=at)
            elif hand.grips and end is not None and not hand.lost_for:
                down = below(hand, alignment)
                if index == self._rigid and "primary" in hand.buttons and down is not None:
                    pointing, limited = tilted(pointing, down, dt, self.settings.orientation)
                else:
                    hands[index] = replace(hand, target=end)
        return replace(state, left=hands[0], right=hands[1], pointing=pointing, limited=limited)

    @property
    def _rigid(self) -> int:
        """Which of both hands has the rigid target."""
        return ("left", "right").index(self.settings.rigid_hand)

    def _targets(self, state: TeleoperationState, message: Input) -> Targets | None:
        if state.mode not in AIMING and state.pinned is not None:
            return offered(state.pinned.request.targets, message.offer)
        rigid, tip, held_object = (
            state.hands[self._rigid].target,
            state.hands[1 - self._rigid].target,
            message.world.held_object,
        )
        if rigid is None or (tip is None and held_object is None):
            return None
        targets = self._placed(rigid, tip, state, message)
        return targets if held_object is not None else offered(targets, message.offer)

    def _placed(self, rigid: Vector, tip: Vector | None, state: TeleoperationState, message: Input) -> Targets:
        """Targets there; `tip` may be None where the arm holds an object."""
        wrist, world, last = wrist_of(message.joints, self.mount_offset), message.world, state.aligned
        if (object := world.held_object) is not None:
            return bring(object, rigid, state.pointing, state.limited, wrist, last.half_plane, world, self.reach)
        assert tip is not None
        return place(rigid, tip, state.pointing, state.limited, wrist, last, world, self.reach, self.settings)

    def _nearest(self, state: TeleoperationState, message: Input, targets: Targets) -> tuple[Targets, str]:
        """What is followed in place of `targets`, and a notice of it: these, "" where they are within reach; else what
        is offered, the mount's place first, as it moves what the arm reaches; these where that is not within either."""
        reason = out_of_reach(targets)
        if not reason:
            return targets, ""
        rigid = targets.rigid.offer or targets.rigid.position
        nearest = self._placed(rigid, targets.tip.position, state, message)
        if nearest.tip.offer is not None:
            nearest = self._placed(rigid, nearest.tip.offer, state, message)
        return (targets, "") if why_not(nearest) else (nearest, f"{reason}; {GOES}")

    def _remembered(self, state: TeleoperationState, targets: Targets) -> TeleoperationState:
        """The state with `targets` in its history, which keeps what may be looked back to."""
        now = state.stamp
        assert now is not None
        state = replace(state, aligned=Aligned(targets.heading, targets.half_plane, targets.turned))
        if state.history and now <= state.history[-1][0]:
            return state
        since = now - max(self.settings.look_back, self.settings.follow_delay)
        older = sum(1 for stamp, _ in state.history if stamp <= since)  # of which the newest is still looked back to
        return replace(state, history=(*state.history[max(older - 1, 0) :], (now, targets)))

    def _after(
        self,
        state: TeleoperationState,
        message: Input,
        events: dict[Event, bool],
        notice: str,
        targets: Targets | None,
        dt: float,
        ends: Ends,
    ) -> tuple[TeleoperationState, Intent]:
        """The next state by the table, and its intent."""
        before, event = state.mode, first_event(state.mode, events)
        mode = before if event is None else TRANSITIONS[before, event]
        step = dt if math.isfinite(dt) and dt > 0 else 0.0
        quiet = state.idle and not events.get("lost")
        state = replace(
            state,
            mode=mode,
            waited=state.waited + step if mode == before else 0.0,
            sound_for=state.sound_for + step if quiet else 0.0,
            notice=notice or (state.notice if mode == before else ""),
            running=mode == "execute" and (state.running or message.executor.mode == "running"),
        )
        if event == "ask":
            state = self._request_plan(state, message)
            assert state.pinned is not None
            targets = state.pinned.request.targets
        elif event == "planned":
            assert message.plan is not None
            state = replace(state, digest=message.plan.digest)
        elif event == "follow":
            assert targets is not None
            state = replace(state, pinned=self._pin(state.serial, targets, message), history=state.history[-1:])
        elif mode == "aim" and (before == "aim" or event == "void"):
            state = self._offers_taken(state, targets)
        if mode not in PLANNED:
            state = replace(state, pinned=None, digest="", following=None)
        if mode in ("hold", "stopped") or (mode == "aim" != before):
            state = replace(state, history=())
        if mode == "follow":
            wanted = state.before(self.settings.follow_delay)
            state = replace(state, following=state.following if why_not(wanted) else wanted)
        return state, self._intent(state, targets, ends)

    def _request_plan(self, state: TeleoperationState, message: Input) -> TeleoperationState:
        """Everything pinned to what the plan is asked for; both hands' targets are those of before the press."""
        wanted = looked_back(state, self.settings)
        assert wanted is not None
        wanted = replace(wanted, better=None)  # of an older plan
        positions = (wanted.rigid.position, wanted.tip.position)
        hands = [replace(state.hands[i], gripped_at=None, target=positions[i != self._rigid]) for i in (0, 1)]
        pinned = self._pin(state.serial + 1, wanted, message)
        return replace(state, left=hands[0], right=hands[1], serial=state.serial + 1, pinned=pinned)

    def _pin(self, serial: int, targets: Targets, message: Input) -> Pinned:
        assert message.alignment is not None
        return Pinned(Request(serial, targets, message.world.digest, self.package), message.alignment, message.world)

    def _offers_taken(self, state: TeleoperationState, targets: Targets | None) -> TeleoperationState:
        """Targets moved to what was offered, of hands whose primary button was pressed with the grip let go."""
        hands = list(state.hands)
        for index, hand in enumerate(hands):
            if targets is not None and "primary" in hand.pressed and not hand.grips:
                offer, better = (targets.rigid if index == self._rigid else targets.tip).offer, targets.better
                if index == self._rigid and better is not None:
                    offer, state = better.rigid, replace(state, pointing=better.pointing)
                hands[index] = replace(hand, target=offer or hand.target)
        return replace(state, left=hands[0], right=hands[1])

    def _intent(self, state: TeleoperationState, targets: Targets | None, ends: Ends) -> Intent:
        motion: Motion = "hold"
        if state.mode == "execute" or (state.mode == "follow" and state.following is not None):
            motion = "execute" if state.mode == "execute" else "follow"
        notice = state.notice
        if state.mode == "follow" and why_not(targets):
            notice = f"{out_of_reach(targets) or why_not(targets)}; {STAYS}"
        return Intent(
            state.mode,
            motion,
            notice,
            targets,
            ends,
            request=state.pinned.request if state.mode == "plan" and state.pinned else None,
            preview=state.digest if state.mode in ("preview", "ready", "delay") else "",
            execute=state.digest if state.mode == "execute" else "",
            countdown=max(self.settings.delay - state.waited, 0.0) if state.mode == "delay" else 0.0,
            follow=state.following if motion == "follow" else None,
        )
