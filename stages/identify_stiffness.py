"""Identify bending stiffness from static shapes, or from releases where there are none."""

from pathlib import Path

from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.pipeline.identify import run
from trunkline.pipeline.stage import run_stage

Config = IdentificationSettings


def main(config: Config) -> None:
    run("identify_stiffness", config, Path("artifacts/build_mjcf/arm.xml"))


if __name__ == "__main__":
    run_stage("identify_stiffness", Config, main)
