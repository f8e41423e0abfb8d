"""The study of one spoilt trial counts what it says, of the whole arm and of the tip."""

from dataclasses import replace

from studies import spoilt
from studies.spoilt import NEVER, SPOILS, Found
from tests.support.matched_plant import release, small_model, tilt

CLEAN = Found(position=2.0, tip=5.0, told={}, parameters={})


def test_errors_are_over_those_of_the_clean_session():
    assert replace(CLEAN, position=2.1, tip=6.0).over(CLEAN).tolist() == [1.05, 1.2]


def test_a_tip_that_a_spoilt_trial_moves_is_seen_beside_a_mean_that_it_does_not(monkeypatch, capsys):
    model = small_model(4)
    kinds = {"identify_damping": release, "identify_stiffness": tilt}
    shown = {
        stage: [kind(model, 30 if kind is tilt else 0.2, split, seed=seed)
                for seed, split in enumerate(("identify", "identify", "validate"))]
        for stage, kind in kinds.items()
    }  # fmt: skip

    def found(stage, trials, outlying=None):
        if any(trial.level == 99 for trial in trials):
            return Found(2.1, 9.0 if outlying == NEVER else 6.0, {}, {})
        return CLEAN

    monkeypatch.setattr(spoilt, "found", found)
    monkeypatch.setattr(spoilt, "require_demo", lambda path: None)
    monkeypatch.setattr(spoilt, "read_reported", lambda config: shown[f"identify_{config.kind}"])
    monkeypatch.setattr(spoilt, "settings_of", lambda stage: Settings(stage))
    spoils = tuple(replace(spoil, change=lambda trial, rng: replace(trial, level=99)) for spoil in SPOILS)
    monkeypatch.setattr(spoilt, "SPOILS", spoils)
    monkeypatch.setattr("sys.argv", ["spoilt", "--sessions", "2"])
    assert spoilt.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert "identify_damping without a spoilt trial: position 2.000 mm, tip 5.000 mm; named: none" in lines
    rows = [line for line in lines if line.startswith(("| 0 |", "| 1 |"))]
    assert [row.split(" | ")[3:7] for row in rows] == [["1.050", "1.200", "1.050", "1.800"]] * 2
    assert lines[-1] == "within 10 % of the clean session: 2 by position and 0 by tip of 2; named: 0; rightly: 0"


class Settings:
    """Of a stage, what the study asks of it."""

    def __init__(self, stage):
        self.kind = stage.removeprefix("identify_")
        self.experiments = ["release" if self.kind == "damping" else "static_tilt"]
