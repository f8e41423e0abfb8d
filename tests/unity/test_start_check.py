"""What the proof of a package's start looks at: when the tip is held against its rest, and which is the worst."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from trunkline.errors import InputError
from trunkline.unity import start_check
from trunkline.unity.start_check import WATCHED, recreated_error, start_error, started
from trunkline.unity.time_steps import steps_taken

REST = np.array([0.0, 0.1, -0.4])


@dataclass
class Fallen:
    """Stands in for a scene: how far its tip is from REST, m, by the time since it began, s."""

    step: float
    away: dict[float, float]  # from these times on
    anew: dict[float, float] = field(default_factory=dict)  # from when it was compiled anew
    time: float = float("nan")
    looked: list[float] = field(default_factory=list)
    controls: dict[str, float] = field(default_factory=dict)

    @property
    def model(self):
        return SimpleNamespace(nu=2, actuator=lambda number: SimpleNamespace(name=f"motor_{number}"))

    def start(self) -> None:
        self.time = 0.0

    def fixed_update(self, count: int = 1) -> None:
        self.time += count * self.step

    def recreate(self) -> None:
        self.away, self.time = self.anew, 0.0

    def site(self, name: str) -> np.ndarray:
        self.looked.append(round(self.time, 9))
        due = [off for begin, off in self.away.items() if self.time >= begin - 1e-9]
        return REST + [0.6 * due[-1], 0, 0.8 * due[-1]]


@pytest.mark.parametrize("step", [*steps_taken(), 0.002, 0.02])
def test_a_start_is_looked_at_after_one_step_and_after_half_a_second(step):
    scene = Fallen(step, {0.0: 0.0})
    assert start_error(scene, REST) == 0
    assert scene.looked == pytest.approx([step, round(WATCHED / step) * step])
    assert scene.looked[1] == pytest.approx(0.5, abs=step / 2)


@pytest.mark.parametrize(
    ("away", "error"),
    [
        ({0.0: 0.0}, 0.0),
        ({0.0: 0.003}, 0.003),
        ({0.0: 0.007, 0.004: 0.002}, 0.007),  # it begins elsewhere and comes to rest
        ({0.0: 0.002, 0.4: 0.009}, 0.009),  # it begins right and falls
        ({0.0: 0.002, 0.4: 0.001, 0.51: 0.5}, 0.002),  # later is later
    ],
)
def test_the_error_of_a_start_is_the_larger_of_both(away, error):
    assert start_error(Fallen(0.002, away), REST) == pytest.approx(error)


@pytest.mark.parametrize(
    ("anew", "error"),
    [
        ({0.0: 0.01}, 0.0),
        ({0.0: 0.013, 0.003: 0.01}, 0.003),  # at the first step
        ({0.0: 0.01, 0.2: 0.06, 0.202: 0.01}, 0.05),  # at one step between
        ({0.0: 0.01, 0.499: 0.0}, 0.01),  # at the last
        ({0.0: 0.01, 0.501: 5.0}, 0.0),
    ],
)
def test_a_scene_compiled_anew_is_held_against_the_other_at_every_step(anew, error):
    scene, other = Fallen(0.002, {0.0: 0.01}, anew), Fallen(0.002, {0.0: 0.01})
    assert recreated_error(scene, other) == pytest.approx(error)
    assert len(scene.looked) == len(other.looked) == 250
    assert scene.controls == other.controls == {"motor_0": start_check.PULL, "motor_1": -start_check.PULL}
    assert other.time == pytest.approx(2 * WATCHED)


@pytest.fixture
def package(monkeypatch):
    """A package whose start is off by so much, m, by turn and whether the component is there."""

    def say(errors: list[float | None], alone: float = 0.1):
        turns = list(range(len(errors)))
        monkeypatch.setattr(start_check, "turns", lambda tilts: turns)
        monkeypatch.setattr(start_check, "manifest_of", lambda files: SimpleNamespace(actuators=[]))
        monkeypatch.setattr(start_check, "at_rest", lambda model, turn, rest: None if errors[turn] is None else turn)
        monkeypatch.setattr(
            start_check,
            "scene_of",
            lambda files, turn, step, without=False: SimpleNamespace(turn=turn, step=step, off=without),
        )
        slowest = max(steps_taken())

        def error(scene, *_):
            assert errors[scene.turn] is not None
            return alone if scene.off else errors[scene.turn] * (1 if scene.step == slowest else 0.5)

        monkeypatch.setattr(start_check, "start_error", error)
        monkeypatch.setattr(start_check, "recreated_error", lambda scene, other: 2 * error(scene))
        return started(None, {}, [0.0])  # type: ignore[arg-type]

    return say


@pytest.mark.parametrize(
    ("errors", "turns", "most"),
    [([1e-4, 3e-4, 2e-4], 3, 0.3), ([3e-4, None, 2e-4], 2, 0.3), ([None, None, 1e-4], 1, 0.1)],
)
def test_the_proof_is_of_the_worst_known_turn_and_step(package, errors, turns, most):
    assert package(errors) == {
        "start_error_mm": {"turns": turns, "max": pytest.approx(most), "without": pytest.approx(100)},
        "recreated_error_mm": {"turns": turns, "max": pytest.approx(2 * most), "without": pytest.approx(200)},
    }


def test_a_proof_without_any_known_rest_is_none(package):
    with pytest.raises(InputError, match="found no equilibrium of the calibrated arm"):
        package([None, None])
