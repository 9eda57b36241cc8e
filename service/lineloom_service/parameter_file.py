"""The mapper's parameters from a TOML file, a table for each part."""

from __future__ import annotations

import tomllib
from pathlib import Path

from lineloom_core.mapping.config import MapperConfig, config_from
from lineloom_core.parameters import ParameterError
from pydantic_settings import BaseSettings, TomlConfigSettingsSource


def read_config(path: Path) -> MapperConfig:
    """Return the parameters of a file, the defaults of the others. Raises ValueError."""
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file")
    try:
        return config_from(TomlConfigSettingsSource(BaseSettings, path).toml_data)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise ValueError(f"{path}: is not TOML: {error}") from error
    except ParameterError as error:
        raise ValueError(f"{path}: {error}") from error
