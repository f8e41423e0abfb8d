"""A stage's settings: its conf folder composed by Hydra, overridden by its section of params.yaml, checked.

``conf/<stage>/config.yaml`` and its groups hold structure, variants and untuned values; ``params.yaml``
holds, per stage, the values people tune. A key is set in one place only: it is absent from conf, or ``???``,
if it is tuned in params.yaml. A group (a subfolder of ``conf/<stage>``, named in its config.yaml's defaults
list) is chosen in params.yaml by its name: ``arm: spiral``.
"""

import difflib
import json
from pathlib import Path
from typing import Any, TypeVar, dataclass_transform

from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass
from yaml import YAMLError

from trunkline.errors import InputError

Schema = TypeVar("Schema")

UNKNOWN_KEY = "unexpected_keyword_argument"  # what pydantic calls it in a dataclass


@dataclass_transform(kw_only_default=True, field_specifiers=(Field,))
def settings(cls: type[Schema]) -> type[Schema]:
    """Decorate a stage's ``Config`` and the classes nested in it: unknown keys and conversions are refused.

    The class becomes a keyword-only pydantic dataclass. Ranges: ``PositiveFloat``, ``Field(gt=0)``; choices:
    ``Literal``; rules between fields: a ``__post_init__`` that raises ValueError.
    """
    return dataclass(cls, config=ConfigDict(extra="forbid", strict=True), kw_only=True)


def load_config(schema: type[Schema], stage: str, root: str | Path = ".") -> Schema:
    """Compose, override and validate the settings of ``stage``.

    Args:
        schema: a class decorated with ``@settings``.
        stage: name of the stage, of its section in params.yaml and of its folder under ``conf/``.
        root: the folder that holds ``params.yaml`` and ``conf/``.

    Raises:
        InputError: one line that names file and key, what was found and what was expected.
    """
    root = Path(root)
    section = read_section(root / "params.yaml", stage)
    settings = compose_settings(root / "conf" / stage, section, stage)
    return _validate(schema, settings, stage, section)


def read_section(path: Path, stage: str) -> dict[str, Any]:
    """The section ``stage`` of the params file at ``path``, as plain values (``1e-6`` is a number here)."""
    params = _load(path)
    if stage not in params:
        raise InputError(f"{path.name}: no section {stage!r}{_nearest(stage, [str(k) for k in params])}")
    section = {} if params[stage] is None else OmegaConf.to_container(params[stage], resolve=False)
    if not isinstance(section, dict):
        raise InputError(f"{path.name}: {stage}: found {section!r}, expected a section of `key: value` lines")
    return section


def compose_settings(folder: Path, section: dict[str, Any], stage: str) -> dict[str, Any]:
    """Hydra's composition of ``folder`` with the groups that ``section`` names, then its values."""
    if not (folder / "config.yaml").is_file():
        raise InputError(f"{folder / 'config.yaml'}: no such file, expected the settings of stage {stage!r}")
    chosen = _choices(folder, section, stage)
    try:
        with initialize_config_dir(config_dir=str(folder.resolve()), job_name=stage, version_base="1.3"):
            config = compose("config", overrides=[f"{group}={option}" for group, option in chosen.items()])
        OmegaConf.set_struct(config, False)
        values = {key: value for key, value in section.items() if key not in chosen}
        return _without_missing(OmegaConf.to_container(OmegaConf.merge(config, values), resolve=True))
    except (HydraException, OmegaConfBaseException, YAMLError) as error:
        raise InputError(f"conf/{stage}: {error}") from error


def _choices(folder: Path, section: dict[str, Any], stage: str) -> dict[str, str]:
    """The option that ``section`` names for each group of the defaults list in ``folder / config.yaml``."""
    chosen = {}
    for entry in _load(folder / "config.yaml").get("defaults", []):
        for group, default in OmegaConf.to_container(entry).items() if isinstance(entry, DictConfig) else ():
            options, found = group_options(folder)[group], section.get(group, default)
            if found not in options:
                state = "missing" if found == "???" else f"found {found!r}"
                expected = ", ".join(options) + _nearest(str(found), options)
                raise InputError(f"params.yaml: {stage}.{group}: {state}, expected one of {expected}")
            chosen[group] = found
    return chosen


def _without_missing(value: Any) -> Any:
    """``value`` without its ``???`` entries, so that validation reports them as missing."""
    if isinstance(value, dict):
        return {key: _without_missing(item) for key, item in value.items() if item != "???"}
    return value


def group_options(folder: Path) -> dict[str, list[str]]:
    """Config groups in ``folder``: name of the group to the names of its options."""
    return {
        group.name: sorted(option.stem for option in group.glob("*.yaml"))
        for group in sorted(folder.iterdir()) if group.is_dir() and any(group.glob("*.yaml"))
    }


def _load(path: Path) -> DictConfig:
    try:
        config = OmegaConf.load(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (YAMLError, OmegaConfBaseException, UnicodeDecodeError, OSError) as error:
        raise InputError(f"{path.name}: not readable as YAML: {error}") from error
    if not isinstance(config, DictConfig):
        raise InputError(f"{path.name}: found a list, expected `key: value` lines")
    return config


def _validate(schema: type[Schema], settings: dict[str, Any], stage: str, section: dict[str, Any]) -> Schema:
    # JSON mode: strict about numbers and strings, yet lists may fill tuples and mappings dataclasses.
    adapter = TypeAdapter(schema)
    try:
        return adapter.validate_json(json.dumps(settings), strict=True)
    except ValidationError as error:
        problems = sorted(error.errors(), key=lambda e: e["type"] != UNKNOWN_KEY)
        valid = _field_names(adapter.json_schema())
        lines = [_describe(p, stage, section, valid) for p in problems]
        raise InputError(lines[0] + (f" (and {len(lines) - 1} more)" if len(lines) > 1 else "")) from error


def _describe(problem: Any, stage: str, section: dict[str, Any], valid: list[str]) -> str:
    location = ".".join(str(part) for part in (stage, *problem["loc"]))
    top = problem["loc"][0] if problem["loc"] else None
    where = "params.yaml" if top in section or problem["type"] == "missing" else f"conf/{stage}"
    if problem["type"] == UNKNOWN_KEY:
        name = str(problem["loc"][-1])
        return f"{where}: {location}: unknown key{_nearest(name, valid)}"
    if problem["type"] == "missing":
        return f"{where}: {location}: missing, expected a value"
    expected = problem["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
    if problem["type"] == "value_error":
        return f"{where}: {location}: {expected}"
    return f"{where}: {location}: found {problem['input']!r}, expected {expected}"


def _field_names(json_schema: dict[str, Any]) -> list[str]:
    blocks = [json_schema, *json_schema.get("$defs", {}).values()]
    return sorted({name for block in blocks for name in block.get("properties", {})})


def _nearest(found: str, valid: list[str]) -> str:
    matches = difflib.get_close_matches(found, valid, n=1)
    return f", did you mean {matches[0]!r}?" if matches else ""
