"""Each experiment is judged by its judge, with the settings that are meant, and a run succeeds only without a cause."""

from types import SimpleNamespace

import numpy as np
import pytest

from rehearsal import settings
from rehearsal.experiments import bench as benches
from rehearsal.experiments import grasp as grasps
from rehearsal.experiments import handle as handles
from rehearsal.experiments import reach as reaches
from rehearsal.experiments.bench import Staged, perform
from rehearsal.experiments.follow import on_path
from rehearsal.experiments.grasp import grasp
from rehearsal.experiments.handle import handle
from rehearsal.experiments.reach import reach
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending
from tests.rehearsal.frames import FORCE, TIP, UNITS, frame
from tests.rehearsal.test_held import SCENE, handed, run

OBJECT = np.array([0.5, 0.1, 0.2])
FREE = settings.free()


def staged(judge, **more) -> Staged:
    return Staged("touch", 3, None, iter(()), judge, "an object", **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(("ending", "cause", "success", "stated"), [
    (Ending(True), "", True, ""),
    (Ending(True), "aim: beside it", False, "aim: beside it"),
    (Ending(False), "stopped: fault", False, "stopped: fault"),
    (None, "", False, "stopped: the run did not end"),
    ("done", "", False, "stopped: the run did not end"),
])  # fmt: skip
def test_a_run_succeeds_where_its_script_ended_and_its_judge_names_no_cause(ending, cause, success, stated):
    result = staged(lambda *arguments: cause).judged(ending, [], [], 4.5)
    assert (result.success, result.cause) == (success, stated)
    assert (result.experiment, result.seed, result.seconds, result.object) == ("touch", 3, 4.5, "an object")


@pytest.mark.parametrize("ended", [True, False])
def test_who_looks_on_does_so_after_the_judge_and_only_where_a_script_ended(monkeypatch, ended):
    ending, calls = Ending(True) if ended else None, []
    monkeypatch.setattr(benches, "rehearse", lambda session, script: (ending, ["frame"], ["view"]))
    stage_run = staged(lambda result, *args: calls.append("judge") or "", watch=lambda *args: calls.append(args))
    stage_run.session = SimpleNamespace(now=7.0)  # type: ignore[assignment]
    result, frames = perform(stage_run)
    assert frames == ["frame"]
    assert calls == (["judge", (result, ending, ["frame"])] if ended else [])


class Nothing:
    """An operator whose scripts do nothing."""

    left = right = None

    def __getattr__(self, name):
        return lambda *args: iter(())


def bench(session=None, judged=True) -> SimpleNamespace:
    return SimpleNamespace(
        place=lambda rng: OBJECT, operator=lambda rng: Nothing(), session=lambda *args: session, settings=FREE,
        arm=SimpleNamespace(chain=SimpleNamespace(units=UNITS)), judged=judged,
        config=SimpleNamespace(core=SimpleNamespace(follow_delay=0.4)),
    )  # fmt: skip


def judged(stage_run: Staged, ending: Ending, frames: list, views: list | None = None) -> Result:
    return stage_run.judged(ending, frames, views or [], 1.0)


@pytest.mark.parametrize(("unit", "success"), [
    (UNITS - 1, True), (UNITS - FREE.tip_units, True), (UNITS - FREE.tip_units - 1, False),
])  # fmt: skip
def test_a_reach_is_by_the_last_units_of_the_settings(unit, success):
    frames = [frame(tip=OBJECT), frame(object={unit: FORCE}, tip=OBJECT + [0.0, 0.0, 0.02])]
    ending = Ending(True, "", 2, aimed=0.01, previewed=0.02)
    result = judged(reach(bench(), 0), ending, frames)  # type: ignore[arg-type]
    assert result.success is success
    assert (result.plans, result.aimed_mm, result.previewed_mm, result.nearest_mm) == (2, 10.0, 20.0, 0.0)


@pytest.mark.parametrize(("aimed", "kind"), [(FREE.diameter / 2, "missed"), (0.51 * FREE.diameter, "aim")])
def test_an_aim_beside_the_object_is_one_beyond_its_radius(aimed, kind):
    result = judged(reach(bench(), 0), Ending(True, aimed=aimed), [frame(tip=OBJECT)])  # type: ignore[arg-type]
    assert result.cause.startswith(kind)


@pytest.mark.parametrize(
    ("done", "judged", "radius"), [(True, True, 4.0), (False, True, np.nan), (True, False, np.nan)]
)
def test_what_was_stated_of_a_reach_is_told_where_it_was_done(monkeypatch, done, judged, radius):
    """And where anybody looks at previews."""
    stated = SimpleNamespace(spread=(0.004,), times=(0.0,), tip=((0.0, 0.0, 0.0),), miss=0.002)
    session = SimpleNamespace(
        controller=SimpleNamespace(plan=SimpleNamespace(duration=1.0), prediction=stated),
        in_client_frame=lambda tip: tip + [0.0, 0.0, 0.01], request=SimpleNamespace(targets="of the plan"),
        executor=SimpleNamespace(hangs="as seen"),
    )  # fmt: skip
    tips = {"after_2s": np.array([0.0, 0.003, 0.0]), "after_10s": np.zeros(3)}
    monkeypatch.setattr(reaches, "tips_after", lambda alone, plan: tips)
    corrections, ran = [], []
    monkeypatch.setattr(reaches, "plan_that_corrects", lambda again, request, hangs, plan: f"hangs {hangs}")
    monkeypatch.setattr(reaches, "execute", lambda again, plan: ran.append(plan))
    monkeypatch.setattr(reaches, "tell_correction", lambda *args: corrections.append(args))
    result, stage_run = Result("reach", 0, True), reach(bench(session, judged), 0)  # type: ignore[arg-type]
    stage_run.watch(result, Ending(done), [frame(0.0, "execute"), frame(1.0, "aim", tip=np.zeros(3))])  # type: ignore[misc]
    np.testing.assert_equal((result.radius_mm, result.after_2s_mm), (radius, radius - 1))
    np.testing.assert_allclose((result.touching_mm, result.plan_end_mm), (radius + 6, radius / 2))
    assert [args[3] for args in corrections] == ["of the plan"] * int(np.isfinite(radius))
    assert ran == [args[2] for args in corrections] == ["hangs as seen"] * int(np.isfinite(radius))


@pytest.mark.parametrize(("seconds", "success"), [(FREE.interruption, True), (FREE.interruption + 0.25, False)])
def test_following_may_be_interrupted_for_as_long_as_the_settings_say(seconds, success):
    session = SimpleNamespace(refusals=[(t, "collision: arm") for t in np.arange(2.0, 2.0 + seconds + 0.01, 0.25)])
    path, stage_run = on_path(bench(session), 0)  # type: ignore[arg-type]
    path.begin(1.0)
    views = [SimpleNamespace(now=now, tip=np.zeros(3), intent=SimpleNamespace(notice="", follow=None))
             for now in np.arange(0.0, 30.0, 0.25)]  # fmt: skip
    frames = [frame(now, "follow", tip=path(now - 0.4)) for now in np.arange(1.0, 17.0, 0.25)]
    result = judged(stage_run, Ending(True), frames, views)
    assert result.success is success
    assert result.tip_mm < 1e-6, "by the delay of the settings"


@pytest.fixture
def stood(monkeypatch):
    """Grasps and hand-overs without a robot."""
    session = SimpleNamespace(prediction=None, robot=SimpleNamespace(scene=SCENE))
    offered = SimpleNamespace(name="standing basket", object=SimpleNamespace(position=[0.5, 0.0, 0.2]))
    for module in (grasps, handles):
        monkeypatch.setattr(module, "offered", lambda *args: offered)
        monkeypatch.setattr(module, "session_of", lambda *args: session)
        monkeypatch.setattr(module, "beside", lambda *args: np.zeros(3))


@pytest.mark.parametrize(("frames", "success", "agreed"), [(run(), True, 1.0), (run(lifted=0.0), False, 0.0)])
def test_a_grasp_is_judged_and_told_with_what_came(stood, frames, success, agreed):
    result = judged(grasp(bench(), 0), Ending(True, plans=2, probability=0.8), frames)  # type: ignore[arg-type]
    assert (result.success, result.agreed, result.plans, result.object) == (success, agreed, 2, "standing basket")


@pytest.mark.parametrize(
    ("frames", "success", "agreed"), [(handed(), True, 1.0), (handed(object={TIP: FORCE}), False, 0.0)]
)
def test_a_hand_over_is_judged_and_told_with_what_came(stood, frames, success, agreed):
    result = judged(handle(bench(), 0), Ending(True, plans=2, probability=0.8), frames)  # type: ignore[arg-type]
    assert (result.success, result.agreed, result.plans, result.object) == (success, agreed, 2, "standing basket")
