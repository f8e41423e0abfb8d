"""A project with a gate: one stage, its limits, its baseline, in Git."""

import json
import subprocess

from upkeep import baseline, gate
from upkeep.limits import read_limits

METRICS = "artifacts/{}/metrics.json"
LIMITS = """
fit:
  error.validate: {max: 2.0, slack: 0.01, below: {key: error.cad, factor: 5}}
  accuracy: {min: 0.9}
  spread: {better: lower}
  watertight: {equals: true}
  opset: {equals: 15}
"""
GOOD = {"error": {"validate": 1.0, "cad": 8.0}, "accuracy": 0.95, "spread": 4.0, "watertight": True, "opset": 15}


def made(folder):
    """The project in `folder`, its first baseline committed."""
    (folder / "tests").mkdir(parents=True)
    (folder / "dvc.yaml").touch()
    (folder / "tests" / "limits.yaml").write_text(LIMITS)
    (folder / "artifacts" / "fit").mkdir(parents=True)
    write(folder, GOOD)
    git(folder, "init", "-q")
    commit(folder)
    assert renew(folder, "the first") == 0
    commit(folder)
    return folder


def write(project, metrics):
    (project / "artifacts" / "fit" / "metrics.json").write_text(json.dumps(metrics))


def git(project, *arguments):
    identity = ["-c", "user.name=test", "-c", "user.email=test@localhost"]
    subprocess.run(["git", *identity, *arguments], cwd=project, check=True)


def commit(project):
    git(project, "add", "-A")
    git(project, "commit", "-qm", "metrics")


def renew(project, *reason):
    return baseline.main(project, list(reason))


def stored(project):
    return json.loads((project / "tests" / "baseline.json").read_text())


def gate_failures(project):
    file = project / "tests" / "limits.yaml"
    return gate.failures(read_limits(file), baseline.read_baseline(baseline.baseline_file(file)), project)


def changed(**changes):
    metrics = json.loads(json.dumps(GOOD))
    for key, value in changes.items():
        holder = metrics["error"] if key in metrics["error"] else metrics
        holder[key] = value
    return metrics
