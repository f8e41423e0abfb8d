"""A stage's settings: its conf folder composed by Hydra, overridden by its section of params.yaml, checked.

`conf/<stage>/config.yaml` and its groups hold structure, variants and untuned values; `params.yaml`
holds, per stage, the values people tune. A key is set in one place only: it is absent from conf, or `???`,
if it is tuned in params.yaml. A group (a subfolder of `conf/<stage>`, or of `conf/shared` if several stages
use it, named in config.yaml's defaults list) is chosen in params.yaml by its name: `arm: spiral`.
"""

import json
import runpy
from collections.abc import Collection
from pathlib import Path
from typing import Any, TypeVar

from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import InterpolationToMissingValueError, OmegaConfBaseException
from pydantic import TypeAdapter, ValidationError
from yaml import YAMLError

from trunkline.errors import InputError, nearest
from trunkline.pipeline.validation_errors import describe, in_order, others_missing, path_of
from trunkline.settings import read_yaml, rename_keys

Schema = TypeVar("Schema")

SHARED = "shared"  # folder beside those of the stages, of groups that several of them use
PROJECT = Path(__file__).parents[2]
RENAMED = {("build_mjcf", "arm"): {"segments": "markers"}}  # stage and group to keys of the release before


def load_config(schema: type[Schema], stage: str, root: str | Path = ".") -> Schema:
    """Compose, override and validate the settings of `stage`.

    Args:
        schema: a class decorated with `@settings`.
        stage: name of the stage, of its section in params.yaml and of its folder under `conf/`.
        root: the folder that holds `params.yaml`, and `conf/` unless it is the project's.

    Raises:
        InputError: one line that names file and key, what was found and what was expected.
    """
    params, folder = Path(root) / "params.yaml", own_or_project(Path(root), "conf") / stage
    section = _read_section(params, stage)
    composed = compose_settings(folder, section, f"{params}: {stage}")
    for (of, group), keys in RENAMED.items():
        if of == stage and isinstance(composed.get(group), dict):
            rename_keys(composed[group], keys, f"{folder}: {stage}.{group}")
    # JSON mode: strict about numbers and strings, yet lists may fill tuples and mappings dataclasses.
    adapter = TypeAdapter(schema)
    try:
        return adapter.validate_json(json.dumps(composed), strict=True)
    except ValidationError as error:
        problems = in_order(error.errors(), composed)
        first, more = problems[0], len(problems) - 1
        path, described = [stage, *map(str, path_of(first, composed))], describe(first, adapter)
        ruled = described.split(":")[0]  # a rule between the stage's fields names the one that breaks it
        if not first["loc"] and ruled.split(".")[0] in composed:
            path, described = [*path, *ruled.split(".")], described.removeprefix(f"{ruled}: ")
        tuned = first["type"] == "missing" or (len(path) > 1 and path[1] in section)
        file, chosen = params if tuned else folder, _choices(folder, section, "")
        if len(path) > 1 and path[1] in chosen:  # a group's values are in the file that params.yaml names
            file = group_options(folder)[path[1]][chosen[path[1]]]
        where = f"{file}: {'.'.join(path)}"
        others = others_missing(problems, composed) or (f" (and {more} more)" if more else "")
        raise InputError(f"{where}: {described}{others}") from error


def load_folder(schema: type[Schema], folder: Path, renamed: dict[str, str] | None = None) -> Schema:
    """The settings of what is no stage, such as teleoperation: `folder / "config.yaml"` alone, which tunes nothing.

    Args:
        renamed: keys of the release before, which are read too, to the ones of now.

    Raises:
        InputError: one line that names the folder and key, what was found and what was expected.
    """
    values = compose_settings(folder, {}, str(folder))
    rename_keys(values, renamed or {}, str(folder))
    return validated(schema, values, folder)


def validated(schema: type[Schema], values: dict, source: Path) -> Schema:
    """`values`, read from `source`, as settings.

    Raises:
        InputError: one line that names the source and key, what was found and what was expected.
    """
    adapter = TypeAdapter(schema)
    try:
        return adapter.validate_json(json.dumps(values), strict=True)
    except ValidationError as error:
        problems = in_order(error.errors(), values)
        where = ".".join(map(str, path_of(problems[0], values)))
        problem = describe(problems[0], adapter) + others_missing(problems, values)
        raise InputError(f"{source}: {where}: {problem}") from error


def check_settings(root: str | Path = ".", only: Collection[str] | None = None) -> list[str]:
    """Validate the settings of every stage in `root / "dvc.yaml"`, or of `only` some, and return their names.

    Raises:
        InputError: for the first bad value in any section, or a section of no stage in dvc.yaml.
    """
    root = Path(root)
    params, stages = root / "params.yaml", list(read_yaml(root / "dvc.yaml").stages)
    for section in read_yaml(params):
        if section not in stages:
            raise InputError(f"{params}: {section}: no such stage in dvc.yaml{nearest(str(section), stages)}")
    checked = stages if only is None else only
    files = [file for file in sorted(own_or_project(root, "stages").glob("*.py")) if file.stem in checked]
    for file in files:
        settings_of(file.stem, root)
    return [file.stem for file in files]


def settings_of(stage: str, root: str | Path = ".") -> Any:
    """The settings of `stage`, as the class `Config` of its file in `stages/` has them; else as `load_config`."""
    file = own_or_project(Path(root), "stages") / f"{stage}.py"
    return load_config(runpy.run_path(str(file), run_name=stage)["Config"], stage, root)


def compose_settings(folder: Path, section: dict[str, Any], where: str) -> dict[str, Any]:
    """Hydra's composition of `folder` with the groups that `section` names, then its values.

    `where` begins the message of an InputError about `section`.
    """
    if not (folder / "config.yaml").is_file():
        raise InputError(f"{folder / 'config.yaml'}: no such file, expected the stage's settings")
    chosen = _choices(folder, section, where)
    try:
        with initialize_config_dir(version_base="1.3", config_dir=str(folder.resolve())):
            overrides = [f"{group}={option}" for group, option in chosen.items()]
            if (folder.parent / SHARED).is_dir():
                overrides.append(f'hydra.searchpath=["file://{(folder.parent / SHARED).resolve()}"]')
            config = compose("config", overrides=overrides)
        OmegaConf.set_struct(config, False)
        values = {key: value for key, value in section.items() if key not in chosen}
        merged = OmegaConf.merge(config, values)
        assert isinstance(merged, DictConfig)  # as `config` is
        return _plain(merged)
    except (HydraException, OmegaConfBaseException, YAMLError) as error:
        raise InputError(f"{folder}: {error}") from error


def group_options(folder: Path) -> dict[str, dict[str, Path]]:
    """The config groups that `folder / "config.yaml"` names, each with its options and their files."""
    options = {}
    for group in _defaults(folder):
        local = folder / group
        files = (local if local.is_dir() else folder.parent / SHARED / group).glob("*.yaml")
        options[group] = {file.stem: file for file in sorted(files)}
    return options


def own_or_project(root: Path, name: str) -> Path:
    """`root / name`; the project's where `root` is another pipeline of the same stages.

    Raises:
        InputError: neither is there, as where the library is installed without its repository.
    """
    for folder in (root / name, PROJECT / name):
        if folder.is_dir():
            return folder
    raise InputError(f"{root / name}: no such folder, expected a checkout of Trunkline")


def _read_section(path: Path, stage: str) -> dict[str, Any]:
    params = read_yaml(path)
    if stage not in params:
        raise InputError(f"{path}: no section {stage!r}{nearest(stage, [str(key) for key in params])}")
    section = {} if params[stage] is None else container(params)[stage]
    if not isinstance(section, dict):
        raise InputError(f"{path}: {stage}: found {section!r}, expected a section of `key: value` lines")
    _expect_names(section, f"{path}: {stage}")
    return section


def _expect_names(section: dict[Any, Any], where: str) -> None:
    for key, value in section.items():
        if not isinstance(key, str):
            raise InputError(f"{where}: found the key {key!r}, expected a name")
        if isinstance(value, dict):
            _expect_names(value, f"{where}.{key}")


def _choices(folder: Path, section: dict[str, Any], where: str) -> dict[str, str]:
    """The option that `section` names for each group of the defaults list in `folder / config.yaml`."""
    chosen, defaults = {}, _defaults(folder)
    for group, options in group_options(folder).items():
        option = section.get(group, defaults[group])
        if option not in list(options):
            state = "missing" if option in ("???", None) else f"found {option!r}"
            expected = ", ".join(options) + nearest(str(option), list(options))
            raise InputError(f"{where}.{group}: {state}, expected one of {expected}")
        chosen[group] = option
    return chosen


def _defaults(folder: Path) -> dict[str, str]:
    """Each group of the defaults list with the option that it names, often ???."""
    entries = container(read_yaml(folder / "config.yaml")).get("defaults", [])
    return {group: option for entry in entries if isinstance(entry, dict) for group, option in entry.items()}


def container(config: DictConfig, resolve: bool = False) -> dict[Any, Any]:
    """`config` as plain values; its keys are what YAML makes of them."""
    values = OmegaConf.to_container(config, resolve=resolve)
    assert isinstance(values, dict)
    return values


def _plain(config: DictConfig) -> dict[str, Any]:
    """`config` as plain values, without its `???` entries, so that validation reports them as missing."""
    try:
        return _without_missing(container(config, resolve=True))
    except InterpolationToMissingValueError:  # then the missing value is the mistake, and validation names it
        return _without_missing(container(config))


def _without_missing(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_missing(item) for key, item in value.items() if item != "???"}
    return value
