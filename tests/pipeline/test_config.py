"""Settings: what people type is composed, checked, and refused in one line that names the key."""

import runpy
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import yaml
from omegaconf import OmegaConf
from pydantic import Field, TypeAdapter, ValidationError

from tests.support.folders import ROOT
from trunkline.errors import InputError
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.model.arm import kinds
from trunkline.pipeline.config import check_settings, compose_settings, group_options, load_config, validated
from trunkline.pipeline.settings import check_once, require_session
from trunkline.settings import settings

STAGES = sorted(file.stem for file in (ROOT / "stages").glob("[!_]*.py"))
LAB = "record"  # the stand-in lab's stage


@dataclass
class Arm:
    """A library's own dataclass: plain, with its ranges in its types."""

    length: Annotated[float, Field(gt=0)]
    tip: float

    def __post_init__(self):
        if self.tip == self.length:
            raise ValueError(f"tip: found {self.tip}, expected another than the length")


@dataclass
class Rod:
    kind: Literal["rod"]
    width: Annotated[float, Field(gt=0, le=9)]


@dataclass
class Hose:
    kind: Literal["hose"]
    width: float


@settings
class Config:
    arm: Arm
    count: int = Field(gt=0)
    loss: Literal["distance", "position"]
    weights: tuple[float, float]
    level: float | None
    part: Annotated[Rod | Hose, Field(discriminator="kind")] | None
    spans: dict[Literal["low", "high"], Arm]

    def __post_init__(self):
        if self.weights[0] > self.weights[1]:
            raise ValueError(f"found weights {self.weights}, expected them to rise")


@pytest.fixture
def project(tmp_path):
    """A project of one stage with one group; call it with the text of its params.yaml section."""
    folder = tmp_path / "conf" / "fit"
    (folder / "arm").mkdir(parents=True)
    (folder / "config.yaml").write_text(
        "defaults:\n  - arm: ???\n  - _self_\ncount: ???\nloss: distance\nweights: [1, 2]\nlevel: null\n"
        "part: null\nspans: {}\n"
    )
    (folder / "arm" / "spiral.yaml").write_text("length: 0.5\ntip: ${count}\n")
    (folder / "arm" / "straight.yaml").write_text("length: 0.3\ntip: 0.01\n")

    def load(section: str) -> Config:
        (tmp_path / "params.yaml").write_text(f"fit: {section}\n")
        return load_config(Config, "fit", tmp_path)

    return load


def test_groups_values_and_interpolations_compose(project):
    config = project("{arm: spiral, count: 3, level: 1e-6}")
    assert config.arm == Arm(length=0.5, tip=3.0)
    assert config.weights == (1.0, 2.0)
    assert config.level == 1e-6  # a number, as OmegaConf reads it; PyYAML reads a string
    assert project("{arm: straight, count: 3}").arm.length == 0.3


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("{arm: spiral, cuont: 3}", "fit.cuont: unknown key, did you mean 'count'?"),
        ("{arm: spiral, count: 3, arm.length: 2}", "fit.arm.length: unknown key"),
        ("{arm: spiral, count: 3.5}", "fit.count: found 3.5, expected a valid integer"),
        ("{arm: spiral, count: '3'}", "fit.count: found '3', expected a valid integer"),
        ("{arm: spiral, count: true}", "fit.count: found True, expected a valid integer"),
        ("{arm: spiral, count: }", "fit.count: found None, expected a valid integer"),
        ("{arm: spiral, count: 0}", "fit.count: found 0, expected greater than 0"),
        ("{arm: spiral, count: 3, loss: posiiton}", "fit.loss: found 'posiiton', expected 'distance' or 'position'"),
        ("{arm: spiral, count: 3, weights: [1, x]}", "fit.weights.1: found 'x', expected a valid number"),
        ("{arm: spiral, count: 3, weights: [2, 1]}", "found weights (2.0, 1.0), expected them to rise"),
        ("{arm: spiral}", "fit.count: missing, expected a value"),
        ("{count: 3}", "fit.arm: missing, expected one of spiral, straight"),
        ("{arm: spirla, count: 3}", "fit.arm: found 'spirla', expected one of spiral, straight, did you mean"),
        ("{arm: {length: 1}, count: 3}", "fit.arm: found {'length': 1}, expected one of spiral, straight"),
        ("[1, 2]", "fit: found [1, 2], expected a section"),
        ("{arm: spiral, count: 3, 4: 5}", "params.yaml: fit: found the key 4, expected a name"),
        ("{arm: spiral, count: 3, spans: {1: {length: 1, tip: 0}}}", "fit.spans: found the key 1, expected a name"),
        ("{arm: spiral, count: 3, part: {kind: rod, width: 2000}}", "width: found 2000, expected more than 0 to 9"),
        ("{arm: spiral, count: 3", "params.yaml: not readable as YAML"),
        ("{arm: spiral, count: 3, spans: {low: {length: 1, tip: 0, tpyo: 1}}}", "fit.spans.low.tpyo: unknown key"),
        ("{arm: spiral, count: 3, spans: {low: {length: '1', tip: 0}}}", "fit.spans.low.length: found '1', expected a"),
        ("{arm: spiral, count: 3, spans: {low: {length: 0, tip: 0}}}", "fit.spans.low.length: found 0, expected great"),
        ("{arm: spiral, count: 3, spans: {low: {length: .nan, tip: 0}}}", "low.length: found nan, expected a finite"),
        ("{arm: spiral, count: 3, spans: {low: {length: 1}}}", "fit.spans.low.tip: missing, expected a value"),
        ("{arm: spiral, count: 3, spans: {low: {length: 1, tip: 1}}}", "fit.spans.low: tip: found 1.0, expected anoth"),
        ("{arm: spiral, count: 3, spans: {lwo: {length: 1, tip: 0}}}", "found 'lwo', expected 'low' or 'high', did "),
        ("{arm: spiral, count: 3, part: {kind: rod, width: 1, tpyo: 1}}", "fit.part.tpyo: unknown key"),
        ("{arm: spiral, count: 3, part: {kind: rdo, width: 1}}", "fit.part: kind: found 'rdo', expected one of 'rod'"),
        ("{arm: spiral, count: 3, part: {width: 1}}", "fit.part: kind: missing, expected a value"),
        ("{arm: spiral, count: 3, level: .inf}", "fit.level: found inf, expected a finite number"),
        ("{arm: spiral, count: 3, level: .nan}", "fit.level: found nan, expected a finite number"),
        ("{arm: spiral, count: '${nothing}'}", "Interpolation key 'nothing' not found"),
    ],
)
def test_a_mistake_is_one_line_that_names_the_key(project, section, message):
    with pytest.raises(InputError) as caught:
        project(section)
    assert message in str(caught.value)


def test_a_mistake_in_a_group_names_the_group_s_own_file(project, tmp_path):
    file = tmp_path / "conf" / "fit" / "arm" / "bent.yaml"
    for text, message in (("length: 1\ntpi: 0\n", "fit.arm.tpi: unknown key, did you mean 'tip'"),
                          ("length: 1\n", "fit.arm.tip: missing"), ("length: 0\ntip: 1\n", "fit.arm.length: found 0")):
        file.write_text(text)
        with pytest.raises(InputError) as caught:
            project("{arm: bent, count: 3, spans: {}}")
        assert str(caught.value).startswith(f"{file}: {message}")


def test_missing_section_and_missing_file(project, tmp_path):
    project("{arm: spiral, count: 3}")
    with pytest.raises(InputError, match="no section 'fitt', did you mean 'fit'"):
        load_config(Config, "fitt", tmp_path)
    (tmp_path / "params.yaml").unlink()
    with pytest.raises(InputError, match="params.yaml: no such file"):
        load_config(Config, "fit", tmp_path)


def test_settings_of_every_stage_are_valid():
    assert check_settings(ROOT) == STAGES


@pytest.fixture
def whole_project(tmp_path):
    """A project of two stages; call it with the text of params.yaml to check it as a stage does before it works."""
    (tmp_path / "dvc.yaml").write_text("stages: {fit: {cmd: x}, train: {cmd: x}}\n")
    (tmp_path / "stages").mkdir()
    for stage in ("fit", "train"):
        (tmp_path / "conf" / stage).mkdir(parents=True)
        (tmp_path / "conf" / stage / "config.yaml").write_text("{}\n")
        (tmp_path / "stages" / f"{stage}.py").write_text(
            "from trunkline.settings import settings\n\n\n@settings\nclass Config:\n    count: int\n"
        )

    def check(params: str, running: str = "") -> None:
        (tmp_path / "params.yaml").write_text(params)
        check_once(running, tmp_path)

    return check


def test_a_stage_checks_the_settings_of_all(whole_project):
    with pytest.raises(InputError, match="train.cuont: unknown key, did you mean 'count'"):
        whole_project("{fit: {count: 1}, train: {cuont: 2}}")
    with pytest.raises(InputError, match="trian: no such stage in dvc.yaml, did you mean 'train'"):
        whole_project("{fit: {count: 1}, trian: {count: 2}}")
    whole_project("{fit: {count: 1}, train: {count: 2}}")
    with pytest.raises(InputError, match="fit.count: found 'x', expected a valid integer"):
        whole_project("{fit: {count: x}, train: {count: 2}}")


@pytest.fixture
def checked(monkeypatch):
    """Which stages are checked, a list for each time."""
    stages: list[list[str]] = []
    monkeypatch.setattr("trunkline.pipeline.settings.check_settings", lambda root, changed: stages.append(changed))
    return stages


def test_a_stage_checks_those_after_it_whose_settings_changed(whole_project, checked):
    whole_project("{fit: {count: 1}, train: {count: 2}}", "fit")
    whole_project("{fit: {count: 1}, train: {count: 2}}")
    whole_project("{fit: {count: 1}, train: {count: 3}}", "train")
    whole_project("{fit: {count: 1}, train: {count: 3}}")
    whole_project("{fit: {count: 1}, train: {count: 3}}")
    assert checked == [["train"], ["fit"], [], ["train"], []]


def test_what_was_mistaken_is_checked_again(whole_project):
    for _ in range(2):
        with pytest.raises(InputError, match="fit.count: found 'x'"):
            whole_project("{fit: {count: x}, train: {count: 2}}")


@pytest.mark.parametrize("file", ["trunkline/ranges.py", "conf/shared/optimizer/short.yaml", "conf/fit/more.yaml"])
def test_what_settings_are_made_of_is_checked_again_once_it_changed(
    whole_project, checked, tmp_path, monkeypatch, file
):
    monkeypatch.setattr("trunkline.pipeline.settings.PROJECT", tmp_path)
    for text in ("low: 0", "low: 0", "low: 1"):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(f"# pydantic\n{text}\n")
        whole_project("{fit: {count: 1}, train: {count: 2}}")
    changed = ["fit"] if "conf/fit" in file else ["fit", "train"]
    assert checked == [["fit", "train"], [], changed]


NO_NAME = "identify_stiffness.parameters.stifness: found 'stifness', expected the name of a parameter"
FIRST, STIFFNESS = "identify_stiffness", "params.yaml: identify_stiffness.parameters.stiffness"


@pytest.mark.parametrize(
    ("stage", "old", "new", "message"),
    [
        (FIRST, "    stiffness:", "    stifness:", f"{NO_NAME}, did you mean 'stiffness'?"),
        (FIRST, "{low: 0.3,", "{low: 30.0,", f"{STIFFNESS}: low: found 30.0, expected less than high, 12.0"),
        (FIRST, "{low: 0.3,", "{lwo: 0.3,", f"{STIFFNESS}.lwo: unknown key, did you mean 'low'?"),
        (FIRST, "{low: 0.3,", "{low: .nan,", f"{STIFFNESS}.low: found nan, expected a finite number"),
        (FIRST, "s: {low: 0.3,", "s: {low: -0.3,", f"{STIFFNESS}.low: found -0.3, expected more than 0"),
        ("fk_dataset", "samples: 200000", "samples: 1000000000000", "found 1000000000000, expected 1000 to 10000000"),
        ("fk_dataset", "gravity: direction ", "gravity: aside ", "'aside', expected one of direction, none, tilt"),
        ("fk_dataset", "seed: 1\n\ntrain_ik", "seed: 9223372036854775808\n\ntrain_ik", "expected 0 to 4294967295"),
    ],
)
def test_a_mistaken_value_of_the_project_s_settings_is_named(tmp_path, stage, old, new, message):
    text = (ROOT / "params.yaml").read_text()
    assert old in text
    (tmp_path / "params.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_config(_schema(stage), stage, tmp_path)
    assert message in str(caught.value)


# of source: what it does not tell of the parameters in params.yaml
UNTOLD = {
    "tilts": ("kp", "capstan"), "releases": ("joint_place", "kp", "rest_bend", "rest_gradient", "capstan"),
    "paths": ("capstan",),
}  # fmt: skip


@pytest.mark.parametrize("stage", STAGES)
def test_every_variant_composes(stage, tmp_path):
    schema, section = _schema(stage), _section(stage)
    for group, options in group_options(ROOT / "conf" / stage).items():
        for option in options:
            chosen = section | {group: option}
            if option in UNTOLD:
                ranges = chosen["parameters"]
                chosen["parameters"] = {name: ranges[name] for name in ranges if not name.startswith(UNTOLD[option])}
            composed = compose_settings(ROOT / "conf" / stage, chosen, stage)
            assert set(composed) <= {field.name for field in fields(schema)}, f"{stage} with {group}={option}"
            OmegaConf.save(OmegaConf.create({stage: chosen}), tmp_path / "params.yaml")
            load_config(schema, stage, tmp_path)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("tilts", "kp: found it to be identified from static_tilt alone, expected one of curl, static_pull, "),
        ("releases", "joint_place: found it to be identified from release alone, expected one of static_tilt, curl, "),
    ],
)
def test_a_parameter_is_refused_where_no_experiment_tells_it(tmp_path, option, message):
    section = _section("identify_stiffness") | {"source": option}
    OmegaConf.save(OmegaConf.create({"identify_stiffness": section}), tmp_path / "params.yaml")
    with pytest.raises(InputError) as caught:
        load_config(IdentificationSettings, "identify_stiffness", tmp_path)
    assert f"params.yaml: identify_stiffness.parameters.{message}" in str(caught.value)


@pytest.mark.parametrize("stage", STAGES)
def test_no_value_is_set_in_both_places(stage):
    conf = OmegaConf.to_container(OmegaConf.load(ROOT / "conf" / stage / "config.yaml"))
    both = _leaves(conf) & _leaves(_section(stage))
    assert not both, f"set in params.yaml and in conf/{stage}/config.yaml: {both}"


@pytest.mark.parametrize("stage", [*STAGES, LAB])
def test_unknown_keys_are_refused_at_every_level(stage, tmp_path):
    schema, root = _schema(stage), _root(stage)
    (tmp_path / "conf").symlink_to(root / "conf")
    groups = group_options(root / "conf" / stage)  # chosen by name, so that params.yaml cannot reach into them
    for path in [(), *(path for path in _nested(schema) if path[0] not in groups)]:
        params = OmegaConf.create({stage: _section(stage)})
        OmegaConf.update(params, ".".join([stage, *path, "tpyo"]), 1, force_add=True)
        OmegaConf.save(params, tmp_path / "params.yaml")
        with pytest.raises(InputError, match=".".join([stage, *path, "tpyo: unknown key"])):
            load_config(schema, stage, tmp_path)


@pytest.mark.parametrize("stage", [*STAGES, LAB])
def test_every_number_has_two_ends_and_is_finite(stage):
    """A setting without an upper bound is a stage that never ends, or that ends for want of memory."""
    for path, node, config in _numbers(TypeAdapter(_schema(stage)).core_schema, stage, {}):
        low, high = node.get("ge", node.get("gt")), node.get("le", node.get("lt"))
        assert None not in (low, high), f"{path}: {node}, expected both ends"
        validator = type(TypeAdapter(float).validator)(node, config)
        for text in ("NaN", "Infinity", "-Infinity", "1e300", "-1e300", str(10**30)):
            with pytest.raises(ValidationError):
                validator.validate_json(text)


def test_a_number_without_an_end_is_found():
    @dataclass
    class Part:
        fine: Annotated[float, Field(ge=0, le=1)]
        open_list: list[Annotated[int, Field(ge=1)]]

    @settings
    class Open:
        parts: dict[str, Part]
        bare: float | None

    paths = [path for path, node, _ in _numbers(TypeAdapter(Open).core_schema, "x", {}) if "le" not in node]
    assert len(paths) == 2
    assert "open_list" in paths[0]
    assert "bare" in paths[1]


def _numbers(node: Any, path: str, config: dict) -> Iterator[tuple[str, dict, dict]]:
    """Every number in a pydantic schema, with the configuration that it is checked under."""
    if isinstance(node, list | tuple):
        for part in node:
            yield from _numbers(part, path, config)
    if not isinstance(node, dict):
        return
    if node.get("type") in ("int", "float", "decimal", "complex"):
        yield path, node, config
    config = node.get("config", config)
    for key, part in node.items():
        if key not in ("metadata", "config", "cls", "fields") or (key == "fields" and isinstance(part[0], dict)):
            yield from _numbers(part, f"{path}.{node.get('name', key)}", config)


def _root(stage: str) -> Path:
    return ROOT / "demo" if stage == LAB else ROOT


def _schema(stage: str) -> type:
    folder = ROOT / ("demo" if stage == LAB else "stages")
    return runpy.run_path(str(folder / f"{stage}.py"), run_name=stage)["Config"]


def _section(stage: str) -> dict:
    params = OmegaConf.load(_root(stage) / "params.yaml")
    return OmegaConf.to_container(params)[stage] or {}


def _leaves(values: dict, prefix: str = "") -> set[str]:
    """Dotted keys that have a value; `???` is none."""
    keys = set()
    for key, value in values.items():
        if isinstance(value, dict):
            keys |= _leaves(value, f"{prefix}{key}.")
        elif value != "???":
            keys.add(f"{prefix}{key}")
    return keys


def _nested(schema: type) -> list[tuple[str, ...]]:
    """Paths of the nested settings classes of a schema."""
    paths = []
    for field in fields(schema):
        if is_dataclass(field.type):
            paths += [(field.name,), *((field.name, *rest) for rest in _nested(field.type))]
    return paths


def test_aliases_that_multiply_are_refused_at_once(project, tmp_path):
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 40)]
    for text, message in (("\n".join(lines), "values by aliases"), ("a: &a [*a]", "an alias within itself")):
        (tmp_path / "params.yaml").write_text(text)
        with pytest.raises(InputError, match=message):
            load_config(Config, "fit", tmp_path)
    assert project("{arm: spiral, count: &n 3, level: *n}").level == 3  # ordinary ones may be


def test_a_session_that_is_not_there_is_named_with_those_that_are(tmp_path):
    (tmp_path / "data/raw/arm_7").mkdir(parents=True)
    (tmp_path / "data/raw/arm_7/session.yaml").touch()
    (tmp_path / "data/raw/arm_8.dvc").touch()
    for name in ("demo", "arm_7", "arm_8"):
        (tmp_path / "params.yaml").write_text(f"ingest: {{session: {name}}}\n")
        require_session(tmp_path)
    (tmp_path / "params.yaml").write_text("ingest: {session: arm_9}\n")
    with pytest.raises(InputError, match="ingest.session: found 'arm_9', expected .*: arm_7, arm_8, demo"):
        require_session(tmp_path)


def test_what_is_pulled_is_this_pipeline_and_its_sessions(tmp_path):
    """Never the examples, which a team may not have run."""
    for data, wanted in ((None, "demo/dvc.yaml"), ("arm_7", "data/raw/arm_7.dvc")):
        if data is not None:
            (tmp_path / "data/raw").mkdir(parents=True)
            (tmp_path / f"data/raw/{data}.dvc").touch()
        for verb in ("pull", "push"):
            command = ["make", "--no-print-directory", "--dry-run", "-f", str(ROOT / "Makefile"), verb]
            output = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False).stdout
            assert output.splitlines()[-1] == f"dvc {verb} dvc.yaml {wanted}"


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("distance", 15, "mine.yaml: tendons.2.distance: found 15, expected less than or equal to 1"),
        ("distance", [0.01, 20], "mine.yaml: tendons.2.distance.1: found 20, expected less than or equal to 1"),
        ("pretension", "4 N", "mine.yaml: tendons.2.pretension: found '4 N', expected a valid number"),
    ],
)
def test_of_a_value_that_may_have_several_forms_the_mistake_within_one_is_named(key, value, message):
    """`tendons` is a number or a list of descriptions, `distance` a number or a pair."""
    arm = yaml.safe_load((ROOT / "conf/build_mjcf/arm/pairs.yaml").read_text())
    arm["tendons"][2][key] = value
    with pytest.raises(InputError) as caught:
        validated(kinds.Arm, arm, Path("mine.yaml"))
    assert str(caught.value) == message
