"""Whether known parameters come back from an arm of the model's own kind: `python -m studies.recovery`

The stand-in lab's cousin does the experiments of the paper's table in a temporary folder, and the project's own stages
identify it there, with the settings of studies/recovery.yaml. Prints the table that holds every parameter against the
truth, and the errors on the split `test` as the stage `score` writes them. Takes some eight minutes of one core.
Progress goes to stderr.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from omegaconf import OmegaConf

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import PROJECT
from upkeep.readme import score_table
from upkeep.results import recorded
from upkeep.truth_table import truth_table

SETTINGS = Path(__file__).with_suffix(".yaml")
LAB = {"plant": "cousin", "experiments": "table"}


def set_up(folder: Path) -> list[str]:
    """Write the settings of the lab and of the stages into `folder`. Returns the stages, in their order."""
    lab = OmegaConf.load(PROJECT / "demo/params.yaml")
    (folder / "demo").mkdir()
    (folder / "demo/conf").symlink_to(PROJECT / "demo/conf")
    OmegaConf.save(OmegaConf.merge(lab, {"record": LAB}), folder / "demo/params.yaml")
    settings = OmegaConf.load(SETTINGS)
    OmegaConf.save(settings, folder / "params.yaml")
    stages = [str(name) for name in settings]
    OmegaConf.save({"stages": {name: {} for name in stages}}, folder / "dvc.yaml")
    return stages


def run(module: str, folder: Path) -> None:
    """A stage, or the lab, in `folder`, with the code of this project.

    Raises:
        InputError: it fails, having said why.
        ChildProcessError: it was killed, which shows nothing about its inputs.
    """
    path = os.pathsep.join(filter(None, [str(PROJECT), os.environ.get("PYTHONPATH")]))
    command = [sys.executable, "-m", module]
    done = subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": path}, stdout=sys.stderr, check=False)
    if done.returncode < 0:
        raise ChildProcessError(f"{module}: killed by signal {-done.returncode}")
    if done.returncode:
        raise InputError(f"{module}: ended with {done.returncode}, expected a stage that ends well")


@in_one_line
def main() -> int:
    argparse.ArgumentParser(prog="studies.recovery", description=__doc__).parse_args()
    with tempfile.TemporaryDirectory() as name, recorded("recovery"):
        folder = Path(name)
        for module in ("demo.record", *(f"stages.{stage}" for stage in set_up(folder))):
            run(module, folder)
        print(truth_table(folder))
        print(score_table(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
