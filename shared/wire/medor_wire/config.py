"""Settings: frozen models whose defaults are trusted, overridden by the environment, then by the command line.

A field `threads` of a settings class of section "dynamics" is read from `MEDOR_DYNAMICS__THREADS`. This is the only
place that reads the environment.
"""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import tyro
from pydantic import BaseModel, ConfigDict, Field, field_validator

PREFIX = "MEDOR_"


class UnknownSetting(ValueError):
    """An environment variable of a known section names no field of it."""


class BusConfig(BaseModel):
    """How a process joins the bus."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    router: str = "tcp/127.0.0.1:7447"
    """Zenoh endpoint of the router, e.g. `tcp/10.0.0.5:7447` or `tls/router:7447`."""
    cell: str = "lab"
    """Name of the robot cell; cells on one router do not see each other."""
    id: str = ""
    """Id of this process on the bus; empty: the name of its service. Replicas need different ids."""
    shared_memory: bool = True
    """Large messages through shared memory between processes of one host. In containers share /dev/shm or say no."""
    tls: Path | None = None
    """Folder with ca.pem, cert.pem and key.pem; for a router address that starts with `tls/`."""
    metrics_port: int = Field(default=0, ge=0, le=65535)
    """Port of this process' Prometheus page; 0: none."""
    log: Literal["auto", "console", "json"] = "auto"
    """Form of the log; auto: readable on a terminal, else JSON lines."""

    @field_validator("cell", "id")
    @classmethod
    def _one_key_chunk(cls, name: str) -> str:
        if any(c in name for c in "/*$#?@") or name != name.strip():
            raise ValueError(f"expected a plain name without any of /*$#?@, got {name!r}")
        return name


class Settings(BaseModel):
    """Base of every service's configuration: `class Config(Settings, section="recon")`."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)
    section: ClassVar[str] = ""

    bus: BusConfig = BusConfig()

    def __init_subclass__(cls, section: str = "", **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.section = section

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] | None = None) -> Self:
        """Defaults overridden by `MEDOR_<SECTION>__<FIELD>` and `MEDOR_BUS__<FIELD>`.

        Raises:
            UnknownSetting: a variable of these sections names no field.
        """
        given = os.environ if environment is None else environment
        return cls(**(_read(cls, cls.section, given) | {"bus": BusConfig(**_read(BusConfig, "bus", given))}))

    @classmethod
    def from_command_line(cls, arguments: Sequence[str] | None = None) -> Self:
        """Defaults, then the environment, then the command line (`--help` shows them all)."""
        return tyro.cli(cls, args=arguments, default=cls.from_environment())


def _read(model: type[BaseModel], section: str, environment: Mapping[str, str]) -> dict[str, Any]:
    """The fields of one section that the environment sets."""
    prefix = f"{PREFIX}{section.upper()}__"
    names = {name.upper(): name for name in model.model_fields}
    found = {}
    for variable, text in environment.items():
        if variable.startswith(prefix):
            field = variable.removeprefix(prefix)
            if field not in names:
                raise UnknownSetting(f"{variable} sets nothing; {section} knows {', '.join(sorted(names))}")
            found[names[field]] = json.loads(text) if text.startswith(("[", "{")) else text
    return found
