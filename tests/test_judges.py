"""Every function that decides a verdict has a table of cases: `tests/support/judges.py` says which those are."""

import ast
import textwrap
from functools import cache
from pathlib import Path

import pytest

from tests.support.judges import judges, read_folder

ROOT = Path(__file__).parents[1]
JUDGES = {  # by function, the test that has its table, and its file below tests/
    "rehearsal.experiments.bench:Staged.judged": (
        "rehearsal/test_bench.py",
        "test_a_run_succeeds_where_its_script_ended_and_its_judge_names_no_cause",
    ),
    "rehearsal.experiments.follow:failure": (
        "rehearsal/test_follow.py",
        "test_a_path_is_followed_where_the_script_ended_well_and_nothing_interrupted",
    ),
    "rehearsal.experiments.follow:interruption": (
        "rehearsal/test_follow.py",
        "test_a_robot_that_stays_too_long_while_the_path_goes_on_is_interrupted",
    ),
    "rehearsal.experiments.grasp:agreed": ("rehearsal/test_held.py", "test_a_preview_agrees_where_the_likelier_came"),
    "rehearsal.experiments.grasp:failure": (
        "rehearsal/test_held.py",
        "test_a_grasp_is_lifted_and_held_by_the_arm_alone_without_slip",
    ),
    "rehearsal.experiments.handle:why_not": (
        "rehearsal/test_held.py",
        "test_a_hand_over_ends_at_rest_on_the_table_alone",
    ),
    "rehearsal.experiments.reach:is_clean": (
        "rehearsal/test_reach.py",
        "test_a_clean_reach_is_near_and_touches_nothing_else",
    ),
    "rehearsal.experiments.reach:failure": (
        "rehearsal/test_reach.py",
        "test_the_first_contact_decides_who_has_reached",
    ),
    "rehearsal.experiments.result:share_of": (
        "rehearsal/test_stated.py",
        "test_of_outcomes_those_that_are_one_are_counted",
    ),
    "rehearsal.experiments.stated:probabilities": (
        "rehearsal/test_stated.py",
        "test_only_what_was_judged_to_agree_counts_as_such",
    ),
    "rehearsal.first_grasp:holds": (
        "rehearsal/test_held.py",
        "test_the_first_grasps_hold_what_is_lifted_does_not_slip_and_does_not_hang",
    ),
    "trunkline.ar.hybrid.outcomes:Holding.holds": ("ar/hybrid/test_rollout_batch.py", "test_what_counts_as_held"),
    "trunkline.ar.hybrid.outcomes:RestCriterion.holds": ("ar/hybrid/test_outcomes.py", "test_what_rests"),
    "trunkline.identification.fit.identify:_at_bound": (
        "identification/test_bounds.py",
        "test_a_parameter_is_at_a_bound_within_a_share_of_its_own_range",
    ),
    "trunkline.identification.fit.identify:_factors_at_bound": (
        "identification/test_bounds.py",
        "test_a_factor_at_a_bound_is_named_with_its_unit",
    ),
    "trunkline.identification.simulate.pose_fit:_descend": (
        "identification/test_bounds.py",
        "test_a_pose_is_found_where_the_descent_ended_before_its_iterations_did",
    ),
    "trunkline.identification.fit.search:_evolve": (
        "identification/test_converged.py",
        "test_an_evolution_has_converged_where_its_losses_came_together",
    ),
    "trunkline.identification.fit.search:descend": (
        "identification/test_converged.py",
        "test_a_descent_has_converged_where_it_ended_before_its_iterations_did",
    ),
    "trunkline.identification.fit.search:search": (
        "identification/test_converged.py",
        "test_only_a_search_whose_starts_agree_has_converged",
    ),
    "trunkline.ar.session.preview_validation:_grasped": (
        "ar/session/test_preview_validation.py",
        "test_what_came_of_a_grasp",
    ),
    "trunkline.ar.session.preview_validation:holds": (
        "ar/session/test_preview_validation.py",
        "test_whether_the_arm_holds_anything",
    ),
    "trunkline.ar.session.preview_validation:lines": (
        "ar/session/test_preview_validation.py",
        "test_whether_the_outcome_agreed_with_what_was_foreseen",
    ),
    "trunkline.kinematics.panda.inverse:solve": (
        "kinematics/panda/test_labels.py",
        "test_a_solution_is_within_both_tolerances_and_free",
    ),
    "trunkline.kinematics.panda.labels:_reached": (
        "kinematics/panda/test_labels.py",
        "test_a_worker_says_of_its_own_points_what_the_solver_does",
    ),
    "trunkline.kinematics.panda.labels:label": (
        "kinematics/panda/test_labels.py",
        "test_every_point_not_reached_gets_the_same_further_starts",
    ),
    "trunkline.kinematics.reachability.reach_signal:held_out": (
        "kinematics/reachability/test_verdicts.py",
        "test_a_held_out_angle_counts_what_its_signal_calls_within_reach",
    ),
    "trunkline.kinematics.reachability.surface_check:check_surfaces": (
        "kinematics/reachability/test_verdicts.py",
        "test_sheets_are_checked_with_tips_and_points_beyond",
    ),
    "trunkline.model.statics.newton:find_equilibrium": (
        "model/statics/test_newton.py",
        "test_balance_alone_is_no_rest",
    ),
}
OTHERWISE = {  # what the word stands for there: no verdict
    "rehearsal.experiments.corrected:correct": "lets the robot correct its plan",
    "trunkline.identification.results.parameter_table:parameter_table": "looks a name up among those at a bound",
    "trunkline.compute.scheduler:spread_rows": "shares rows out to workers",
}


@cache
def deciding() -> frozenset[str]:
    return frozenset(judge.function for judge in judges(read_folder(ROOT)))


def test_every_function_that_decides_has_a_table():
    listed = set(JUDGES) | set(OTHERWISE)
    assert sorted(deciding() - listed) == [], "write a table of cases for these, and list it in JUDGES"
    assert sorted(listed - deciding()) == [], "these decide nothing any more"
    assert not set(JUDGES) & set(OTHERWISE)


@pytest.mark.parametrize("function", JUDGES)
def test_a_table_is_one_and_is_of_its_judge(function):
    """The test is parametrized or loops over rows, and its module names the judge."""
    file, name = JUDGES[function]
    tree = ast.parse((ROOT / "tests" / file).read_text("utf-8"))
    tests = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name]
    assert len(tests) == 1, f"{file}: found {len(tests)} tests {name}"
    parametrized = any("parametrize" in ast.unparse(decorator) for decorator in tests[0].decorator_list)
    assert parametrized or any(isinstance(node, ast.For | ast.comprehension) for node in ast.walk(tests[0]))
    assert function.rpartition(":")[2].rpartition(".")[2] in names(tree)


def names(tree: ast.AST) -> set[str]:
    """All that a file imports, calls or takes as an attribute."""
    nodes = list(ast.walk(tree))
    imported = {alias.name for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names}
    attributes = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    return imported | attributes


@pytest.mark.parametrize(("source", "words"), [
    ("def f(a):\n    success = a < 1", {"f success"}),
    ("def f(a):\n    success = a", set()),
    ("def f(a):\n    success = a.success", set()),
    ("def f(a):\n    success = a['success'][a > 1]", set()),
    ("def f(a):\n    success = True", set()),
    ("def f(a):\n    success = [x for x in a if x > 1]", set()),
    ("def f(a):\n    success = 1 if a > 1 else 2", set()),
    ("def f(a):\n    success = np.where(a > 1, a, 0)", set()),
    ("def f(a):\n    success = np.where(a, a > 1, 0)", {"f success"}),
    ("def f(a):\n    success = a and a.b", {"f success"}),
    ("def f(a):\n    success = not a", {"f success"}),
    ("def f(a):\n    success = a & ~a", {"f success"}),
    ("def f(a):\n    success = np.isfinite(a)", {"f success"}),
    ("def f(a):\n    success = a.any()", {"f success"}),
    ("def f(a):\n    success = float(sum(x > 1 for x in a))", {"f success"}),
    ("def f(a):\n    x, success = a, a > 1", {"f success"}),
    ("def f(a):\n    x, failure = a > 1, a", set()),
    ("def f(a):\n    success: bool = a > 1", {"f success"}),
    ("def f(a):\n    a.held |= a > 1", {"f held"}),
    ("def f(a):\n    a.agreed = a > 1", {"f agreed"}),
    ("def f(a):\n    agreed[a] = a > 1", {"f agreed"}),
    ("def f(a):\n    a['agreed'] = a > 1", {"f agreed"}),
    ("def f(a):\n    return {'agreed': a > 1}", {"f agreed"}),
    ("def f(a):\n    return g(converged=a > 1)", {"f converged"}),
    ("def f(a):\n    if (converged := a > 1):\n        pass", {"f converged"}),
    ("@dataclass\nclass R:\n    x: int\n    at_bound: bool\n\ndef f(a):\n    return R(1, a > 1)", {"f at_bound"}),
    ("def held(a):\n    return a > 1", {"held held"}),
    ("def _held(a):\n    return a > 1", {"_held held"}),
    ("def held(a):\n    return a", set()),
    ("def f(a):\n    held = g(a)\n\ndef g(a):\n    return 1", {"g held"}),
    ("def f(a):\n    held = float(g(a))\n\ndef g(a):\n    return 1", {"g held"}),
    ("def f(a):\n    held, x = g(a)\n\ndef g(a):\n    return 1", {"g held"}),
    ("def f(a):\n    held = map(g, a)\n\ndef g(a):\n    return 1", {"g held"}),
    ("class A:\n    def b(self):\n        return self.x > 1\n\ndef f(a):\n    held = a.b()", {"A.b held"}),
    ("class A:\n    def b(self):\n        return self.x\n\ndef f(a):\n    held = a.b()", set()),
    ("class A:\n    def b(self, x):\n        self.held = x > 1", {"A.b held"}),
    ("def f(a):\n    def g():\n        held = a > 1\n    return g", {"f.g held"}),
    ("reachable = x > 1", {"<module> reachable"}),
])  # fmt: skip
def test_who_decides_is_read_off_the_code(source, words):
    result = judges([("room.module", ast.parse(textwrap.dedent(source)))])
    assert {f"{judge.function.partition(':')[2]} {judge.word}" for judge in result} == words


def test_a_cause_in_words_is_a_verdict_among_the_experiments():
    source = ast.parse('def f(a) -> str:\n    return "" if a else "it fell"\n\ndef g(a) -> str:\n    return "it fell"')
    for module, expected in (("rehearsal.experiments.push", {"f"}), ("trunkline.ar.teleop.targets", set())):
        assert {judge.function.partition(":")[2] for judge in judges([(module, source)])} == expected
