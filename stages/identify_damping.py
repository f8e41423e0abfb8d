"""Identify damping and relaxation from releases."""

from pathlib import Path

from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.pipeline.identify import run
from trunkline.pipeline.stage import run_stage

Config = IdentificationSettings


def main(config: Config) -> None:
    run("identify_damping", config, Path("artifacts/identify_stiffness/arm.xml"))


if __name__ == "__main__":
    run_stage("identify_damping", Config, main)
