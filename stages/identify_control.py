"""Identify the motors' gains and force range from curls and motions."""

from pathlib import Path

from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.pipeline.identify import run
from trunkline.pipeline.stage import run_stage

Config = IdentificationSettings


def main(config: Config) -> None:
    earlier = ("identify_stiffness", "identify_damping")
    run("identify_control", config, Path("artifacts/identify_damping/arm.xml"), whole=earlier)


if __name__ == "__main__":
    run_stage("identify_control", Config, main)
