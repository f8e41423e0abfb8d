"""The benchmark of clusters: times of a known law give that law, and what is told of other machines follows from it."""

import pytest

from benchmarks.cluster import law, tell

A, B, C = 0.1, 0.8, 0.02  # s


def time_of(n: int, cores: int) -> float:
    return A + B / min(n, cores) + C * n


def test_a_known_law_comes_back():
    processes = [1, 2, 4, 8]
    assert law({n: time_of(n, 2) for n in processes}, processes, 2) == pytest.approx((A, B, C, 0), abs=1e-9)
    *_, off = law({n: time_of(n, 2) + (0.1 if n == 2 else 0) for n in processes}, processes, 2)
    assert off > 0.01


def test_what_is_told_follows_from_the_law(capsys):
    times = {f"{n} s": time_of(n, 4) for n in (1, 2, 4)}
    middle = {"0 s": 0.46, **times, "empty s": 0.001, "bytes": 2_000_000}
    slow = {name: 3 * value for name, value in middle.items()} | {"bytes": 2_000_000}
    tell([middle, middle, slow], [1, 2, 4], 4)
    told = capsys.readouterr().out
    assert "| none, one thread | 0.460 s | 0.460 to 1.380 s | 1.00 |" in told
    assert "| 1 | 0.920 s | 0.920 to 2.760 s | 2.00 |" in told
    assert "T(n) = 0.100 s + 0.800 s / min(n, 4) + 0.0200 s n; off by 0 ms RMS at 3 medians" in told
    assert "an empty piece takes 1.0 ms, an evaluation brings back 2.0 MB" in told
    assert "    8 workers: 2.6 times as fast as one" in told, "0.92 s / (0.1 + 0.8 / 8 + 0.02 * 8) s"
    # 15 arms times 60 pieces of 1 ms are 0.90 s, 16 times 64 are more than an evaluation, 0.92 s
    assert "keeps up with 15 arms and as many workers, so 67 schedulers" in told
    assert "workers are at work 87% of the time; 2174 MB/s go to clients" in told
