"""What the operator does, as scripts that are resumed at every frame with what is seen and move the hands.

The rigid hand is the left one. An operator knows the arm's map as the headset shows it: `offset` is where in the soft
base frame, in the bending plane, a tip is well within reach.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np

from rehearsal.operator.hands import HumanOperator, RayHand
from rehearsal.session import View
from trunkline.ar.teleop.reach import MapReach
from trunkline.ar.teleop.vectors import DOWN

Script = Generator[None, View, "Ending"]
Part = Generator[None, View, View]
SETTLED = 0.4  # s after a movement until filter and ray's length have come to rest
CLICK = 0.1  # s for which a button is pressed
ASIDE = np.array([0.0, 0.0, 0.06])  # m by which the rigid ray is moved to drop a plan that was shown
AGAIN = 0.5  # s after which the operator tries to follow again
LIFTED = 0.05  # m from which on the operator sees that something is lifted
GLANCE = 0.1  # s over which a velocity is seen
HAND_OVERS = 2  # previews of a hand-over: how an object lies in the arm does not change from one to the next
CALM = 2.0  # s after an arrival that the operator looks on
LONGEST = 30.0  # s that the operator waits for anything


@dataclass
class Ending:
    """How a script ended. done: whether the robot has done what was confirmed. why: of one that gave up."""

    done: bool
    why: str = ""
    plans: int = 0
    aimed: float = np.nan  # m, from the tip target to the object, as they truly appear
    previewed: float = np.nan  # m, likewise from the tip of the preview
    probability: float = np.nan  # that was shown of the plan confirmed
    offers: int = 0  # of the assistant's that were taken


def offset_of(reach: MapReach) -> np.ndarray:
    """The tip (3,), m, in the dorsal half of the arm's bending plane that is deepest in its map under a mount straight
    down, of those that the arm reaches by bending by no more than about a quarter turn."""
    places = [(float(x), 0.0, float(z)) for x in np.arange(0.06, 0.16, 0.01) for z in np.arange(-0.48, -0.34, 0.01)]
    inside = [place for place in places if reach.soft(place, DOWN).where == "inside"]
    if not inside:
        return np.array([0.1, 0.0, -0.42])
    return np.median(np.array(inside), axis=0)


def on_object(off: np.ndarray, radius: float) -> bool:
    """Whether a preview's tip, `off` (3,), m, from the object's centre, is within the object: then it is confirmed."""
    return bool(np.linalg.norm(off) < radius)


def sure_enough(probability: float | None, accept: float) -> bool:
    """Whether a preview that states so much is confirmed; one that states nothing is, as there is none to wait for."""
    return probability is None or bool(probability >= accept)


class Operator:
    """Two hands, what the object is like, and where the arm's tip is well within reach."""

    def __init__(
        self,
        person: HumanOperator,
        hands: tuple[RayHand, RayHand],
        offset: np.ndarray,
        radius: float,
        band: float,
        rng: np.random.Generator,
        judged: bool = True,
    ) -> None:
        """
        Args:
            radius: of the object, m. band: width of the map's band, m, for which the rigid target is aimed.
            judged: whether a preview beside the object is declined; else the first plan is confirmed.
        """
        self.person, self.offset, self.radius, self.band, self.rng = person, offset, radius, band, rng
        self.judged = judged
        self.left, self.right = hands

    def reach(self) -> Script:
        """Aim, watch the preview, confirm it if its tip is on the object, else aim anew."""
        view = yield from self._until(lambda view: view.intent.mode == "aim")
        beside = np.zeros(3)  # by which the tip target is put beside the object
        why, plans = "", 0
        while plans < self.person.patience:
            plans += 1
            view = yield from self._place_tip(view, beside)
            view, why = yield from self._place_mount(view)
            if why:
                return Ending(False, why, plans)
            view = yield from self._click(self.right, "trigger", view)
            view = yield from self._until(lambda view: view.intent.mode in ("ready", "aim"))
            if view.intent.mode == "aim":
                why = view.intent.notice or "aim: no plan was asked for"
                view = yield from self._react()
                continue
            view = yield from self._react()
            targets, previewed = view.intent.targets, view.previewed
            if targets is None or previewed is None:
                continue
            off = self._look(previewed - view.object)
            ending = Ending(True, "", plans, _away(targets.tip.position, view.object), _away(previewed, view.object))
            if not self.judged or on_object(off, self.radius):
                view = yield from self._click(self.right, "trigger", view)
                view = yield from self._until(lambda view: view.intent.mode == "execute")
                view = yield from self._until(lambda view: view.intent.mode != "execute")
                if view.intent.mode != "aim":
                    return Ending(False, f"stopped: {view.intent.notice}", plans)
                yield from self._wait(CALM)
                return ending
            why, beside = "aim: no preview came to the object", beside - off
            view = yield from self._drop(view)
        return Ending(False, why, plans)

    def grasp(self, beside: np.ndarray, accept: float, watch: float) -> Script:
        """Mark the object, aim the mount beside it, watch the preview, confirm it where it is sure enough, else take
        the assistant's offer, else aim anew; then look on.

        Args:
            beside: of the mount's place, less the object's centre, (3,), m. accept: probability. watch: s.
        """
        view = yield from self._until(lambda view: view.intent.mode == "aim")
        view = yield from self._place_tip(view, np.zeros(3))
        view, why = yield from self._place_at(view, lambda view: view.object + beside)
        ending, unsure = Ending(False, why), ""
        while not ending.why and ending.plans < self.person.patience:
            ending.plans += 1
            view = yield from self._ask(view)
            if view.intent.mode != "ready":
                ending.why = view.intent.notice or "aim: no plan was asked for"
            elif sure_enough(view.probability, accept):
                ending.probability = np.nan if view.probability is None else view.probability
                return (yield from self._confirm(view, ending, watch))
            elif view.offer is not None and sure_enough(view.offer.probability, accept):
                ending.offers += 1
                view = yield from self._take_offer(view)
                unsure = "aim: no preview was as sure to hold as its offer"
                continue
            else:
                unsure = "aim: no preview was sure enough to hold"
                view = yield from self._drop(view)
            if ending.plans < self.person.patience:
                view, ending.why = yield from self._place_at(view, lambda view: view.object + beside)
        ending.why = ending.why or unsure
        return ending

    def handle(self, beside: np.ndarray, spot: Callable[[View], np.ndarray], accept: float, watch: float) -> Script:
        """Grasp, aim so that what is gripped will be at `spot`, as it appears with the object as it then is in the arm,
        (3,), m, confirm what is sure enough to rest there, look on for `watch` s."""
        view = yield from self._until(lambda view: view.intent.mode == "aim")
        hung = view.object
        ending = yield from self.grasp(beside, accept, CALM)
        view = yield from self._react()
        if not ending.done or view.object[2] - hung[2] < LIFTED:
            ending.why = ending.why or "slip: it was not lifted"
            ending.done = False
            return ending
        ending.done, ending.probability = False, np.nan  # what was said of the grasp has come true
        for _ in range(HAND_OVERS):
            view, ending.why = yield from self._place_object(view, spot(view))
            if ending.why:
                return ending
            ending.plans += 1
            view = yield from self._ask(view)
            if view.intent.mode != "ready":
                ending.why = view.intent.notice or "aim: no plan was asked for"
                return ending
            if sure_enough(view.probability, accept):
                ending.probability = np.nan if view.probability is None else view.probability
                return (yield from self._confirm(view, ending, watch))
            view = yield from self._drop(view)
        ending.why = "aim: no preview was sure enough to rest"
        return ending

    def _place_object(self, view: View, spot: np.ndarray):
        """The rigid target to where the object that is held will be at `spot`; why not, "" if it is there."""
        self.left.press("grip", view.now)
        for _ in range(self.person.patience):
            targets = view.intent.targets
            if targets is None:
                view = yield from self._react()
                continue
            goal = spot + np.array(targets.rigid.position) - targets.tip.position
            view = yield from self._aim(self.left, goal, self.band, view.now)
            targets = view.intent.targets
            if targets is None:
                continue
            if targets.rigid.reach in ("outside", "blocked"):
                return view, f"out of reach: rigid target {targets.rigid.reach}"
            if np.linalg.norm(self._look(targets.tip.position - spot)) < self.band / 2:
                return view, ""
        return view, "aim: the object's place was never where it was meant"

    def _ask(self, view: View) -> Part:
        """Ask for a plan, and see its preview to the end, or that there is none."""
        view = yield from self._click(self.right, "trigger", view)
        view = yield from self._until(lambda view: view.intent.mode in ("ready", "aim"))
        return (yield from self._react())

    def _confirm(self, view: View, ending: Ending, watch: float):
        """Confirm what is shown, and look on until it is done, and for `watch` s more."""
        view = yield from self._click(self.right, "trigger", view)
        view = yield from self._until(lambda view: view.intent.mode == "execute")
        view = yield from self._until(lambda view: view.intent.mode != "execute")
        if view.intent.mode != "aim":
            ending.why = f"stopped: {view.intent.notice}"
            return ending
        yield from self._wait(watch)
        ending.done = True
        return ending

    def _take_offer(self, view: View) -> Part:
        """The rigid target to where the assistant has it; the other hand's grip is the dead man's then."""
        self.left.let_go("grip")
        view = yield from self._react()
        view = yield from self._click(self.left, "primary", view)
        view = yield from self._until(lambda view: view.intent.mode == "aim")
        self.right.press("grip", view.now)
        return (yield from self._react())

    def _place_at(self, view: View, goal: Callable[[View], np.ndarray]):
        """The rigid target to `goal`, until it looks so; why not, "" if it is there."""
        self.left.press("grip", view.now)
        for _ in range(self.person.patience):
            view = yield from self._aim(self.left, goal(view), self.band, view.now)
            targets = view.intent.targets
            if targets is None:
                continue
            if targets.rigid.reach in ("outside", "blocked"):
                return view, f"out of reach: rigid target {targets.rigid.reach}"
            if np.linalg.norm(self._look(np.array(targets.rigid.position) - goal(view))) < self.band / 2:
                return view, ""
        return view, "aim: the rigid target was never where it was meant"

    def follow(self, begin: Callable[[float], None], finished: Callable[[float], bool], place: Callable) -> Script:
        """Both rays on the moving object until its path is over: where it appears to be now, as its motion of a
        reaction time ago foretells.

        Args:
            begin: told the time when the robot has come to the object. finished: whether the path is over at a time.
            place: where the object appears at a time, (3,), m.
        """
        view = yield from self._until(lambda view: view.intent.mode == "aim")
        view = yield from self._place_tip(view, np.zeros(3))
        view, why = yield from self._place_mount(view)
        if why:
            return Ending(False, why)
        self.right.press("grip", view.now)
        view = yield from self._react()
        begun, followed, pressed = None, view.now, -np.inf
        while begun is None or not finished(view.now):
            at = self._anticipated(place, view.now)
            self.right.follow(at, view.now)
            self.left.follow(at - self._apart(at), view.now)
            view = yield
            if view.now > pressed + CLICK:
                self.right.let_go("stick_pressed")
            if view.intent.mode == "follow":
                near = _away(view.tip, view.object) < 2 * self.radius
                if begun is None and (near or view.now - followed > LONGEST):
                    begun = view.now
                    begin(begun)
            elif begun is not None or view.now - followed > LONGEST / 3:
                return Ending(False, f"stopped: {view.intent.notice or view.intent.mode}")
            elif view.now > pressed + AGAIN:
                self.right.press("stick_pressed", view.now)
                pressed = view.now
        return Ending(True)

    def _anticipated(self, place: Callable[[float], np.ndarray], now: float) -> np.ndarray:
        """Where the object is taken to be, (3,), m: its place and velocity are seen a reaction time late."""
        late = self.person.reaction
        latest, before = place(now - late), place(now - late - GLANCE)
        return latest + self.person.forecast * late * (latest - before) / GLANCE

    def _place_tip(self, view: View, beside: np.ndarray):
        """The tip target onto the object, until it looks so."""
        self.right.press("grip", view.now)
        for _ in range(self.person.patience):
            view = yield from self._aim(self.right, view.object + beside, 2 * self.radius, view.now)
            end = view.intent.rays[1]
            if end is not None and np.linalg.norm(self._look(end - view.object - beside)) < self.radius / 2:
                break
        self.right.let_go("grip")
        return (yield from self._react())

    def _place_mount(self, view: View):
        """The rigid target so that both are within reach; why not, "" if they are."""
        end = view.intent.rays[1]
        targets = view.intent.targets
        tip = np.array(targets.tip.position if targets is not None else end)
        goal = tip - self._apart(tip)
        self.left.press("grip", view.now)
        for _ in range(self.person.patience):
            view = yield from self._aim(self.left, goal, self.band, view.now)
            targets = view.intent.targets
            if targets is None:
                continue
            tip = np.array(targets.tip.position)
            if targets.rigid.reach == "inside" and targets.tip.reach == "inside":
                return view, ""
            if targets.tip.offer is not None:
                goal = np.array(targets.rigid.position) + 1.5 * (tip - np.array(targets.tip.offer))
            elif targets.rigid.offer is not None:
                goal = np.array(targets.rigid.offer)
        named = "none" if targets is None else f"rigid target {targets.rigid.reach}, tip target {targets.tip.reach}"
        return view, f"out of reach: {named}"

    def _apart(self, tip: np.ndarray) -> np.ndarray:
        """From the mount to the tip, base frame, (3,), m: the arm bends away from the robot's column."""
        outward = np.array([tip[0], tip[1], 0.0]) / np.hypot(tip[0], tip[1])
        return self.offset[0] * outward + [0.0, 0.0, self.offset[2]]

    def _look(self, off: np.ndarray) -> np.ndarray:
        """A distance vector as it is seen: its depth is uncertain."""
        depth = self.right.depth_spread(1.0) * self.rng.normal()
        line = self.right.goal - (self.right.turn.apply(self.right.origin) + self.right.shift)
        return off + depth * line / np.linalg.norm(line)

    def _drop(self, view: View) -> Part:
        """Give up the plan that is shown: the rigid target is aimed anew."""
        self.left.let_go("grip")
        self.right.let_go("grip")
        view = yield from self._react()
        self.left.press("grip", view.now)
        yield from self._wait(CLICK)
        view = yield from self._aim(self.left, self.left.goal + ASIDE, self.band, view.now)
        self.left.let_go("grip")
        return (yield from self._until(lambda view: view.intent.mode == "aim"))

    def _aim(self, hand: RayHand, place: np.ndarray, width: float, now: float) -> Part:
        hand.aim(place, width, now)
        yield from self._wait(self.person.movement + SETTLED)
        return (yield from self._react())

    def _click(self, hand: RayHand, name: str, view: View) -> Part:
        hand.press(name, view.now)
        view = yield from self._wait(CLICK)
        hand.let_go(name)
        return (yield from self._wait(CLICK))

    def _react(self) -> Part:
        spread = self.person.reaction_spread * self.rng.normal()
        return (yield from self._wait(max(self.person.reaction + spread, CLICK)))

    def _wait(self, seconds: float) -> Part:
        view = yield
        begun = view.now
        while view.now < begun + seconds:
            view = yield
        return view

    def _until(self, happened: Callable[[View], bool]) -> Part:
        """Until what is awaited is seen, or for as long as the operator has patience."""
        view = yield
        begun = view.now
        while not happened(view) and view.now < begun + LONGEST:
            view = yield
        return view


def _away(a, b) -> float:
    return float(np.linalg.norm(np.array(a) - np.array(b)))
