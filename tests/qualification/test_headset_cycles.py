"""What the benchmark of cycles in a headset counts."""

from qualification.headset_cycles import CycleRun, table


def test_a_cycle_counts_where_the_robot_has_done_it_and_each_press_was_heard_once():
    good = CycleRun(2, 1, 1, 6, 0.002, "")
    others = [(2, 2, 1, 6, 0.002, ""), (2, 1, 1, 6, 0.002, "hold"), (0, 0, 0, 3, float("nan"), "no touch")]
    runs = [good, *(CycleRun(*numbers) for numbers in others)]
    found = "\n".join(table(runs))
    assert "| full cycles | 1 of 4 | 4 of 4 |" in found
    assert "| each press heard once | 2 of 4 | 4 of 4 |" in found
    assert "| presses; plans asked for; executions | 6; 4; 3 | 8; 4; 4 |" in found
    assert "95th percentile | 2.0 mm" in found
    assert "95th" not in "\n".join(table(runs[3:]))
