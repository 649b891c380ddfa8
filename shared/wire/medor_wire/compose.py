"""compose.yaml as the launcher reads it: which processes make a cell, and with which settings."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

FILE = "compose.yaml"


class ComposeError(ValueError):
    """compose.yaml is missing or does not say what the launcher needs."""


class Deploy(BaseModel):
    replicas: int = Field(default=1, ge=0, le=64)


class Service(BaseModel):
    """One entry under `services:`; what only containers need (image, volumes, health check) is left out."""

    model_config = ConfigDict(frozen=True)

    command: tuple[str, ...] = Field(min_length=1)
    environment: dict[str, str] = {}
    profiles: tuple[str, ...] = ()
    deploy: Deploy = Deploy()
    ports: tuple[str, ...] = ()

    def runs_in(self, profile: str) -> bool:
        """Whether this service belongs to the profile; one without profiles belongs to all."""
        return not self.profiles or profile in self.profiles


@dataclass(frozen=True)
class Replica:
    """One process to run: `name` is the service's, numbered when it has several replicas."""

    name: str
    service: str
    command: tuple[str, ...]
    environment: dict[str, str]


def find(start: Path | None = None) -> Path:
    """compose.yaml of the working directory or of a folder above it, else of the checkout this package stands in.

    Raises:
        ComposeError: there is none.
    """
    here = (start or Path.cwd()).resolve()
    for folder in (here, *here.parents, *Path(__file__).resolve().parents):
        if (folder / FILE).is_file():
            return folder / FILE
    raise ComposeError(f"no {FILE} in {here} or above it; run this inside a checkout of Medor")


def read(path: Path, environment: Mapping[str, str]) -> dict[str, Service]:
    """Services by name, `${...}` filled in from `environment`, settings for containers only (`x-container`) left out.

    Raises:
        ComposeError: not readable, or a service without a command.
    """
    try:
        content = yaml.safe_load(path.read_text())
        inside = {name for block in content.get("x-container", {}).values() for name in block}
        services = {
            name: interpolate(_without(entry, inside), environment) for name, entry in content["services"].items()
        }
        return {name: Service.model_validate(entry) for name, entry in services.items()}
    except (OSError, yaml.YAMLError, KeyError, TypeError, AttributeError, ValidationError) as error:
        raise ComposeError(f"{path}: {error}") from error


def replicas(services: Mapping[str, Service], profile: str) -> list[Replica]:
    """The processes of a profile, in the file's order.

    Raises:
        ComposeError: no service names this profile.
    """
    known = sorted({name for service in services.values() for name in service.profiles})
    if profile not in known:
        raise ComposeError(f"expected a profile of {', '.join(known) or '(none)'}, got {profile}")
    return [
        Replica(name if service.deploy.replicas == 1 else f"{name}-{i}", name, service.command, service.environment)
        for name, service in services.items()
        if service.runs_in(profile)
        for i in range(1, service.deploy.replicas + 1)
    ]


def _without(entry: dict[str, Any], names: set[str]) -> dict[str, Any]:
    settings = entry.get("environment", {})
    return {**entry, "environment": {name: value for name, value in settings.items() if name not in names}}


VARIABLE = re.compile(r"\$(?:\$|(?P<plain>\w+)|\{(?P<name>\w+)(?:(?P<rule>:?[-?])(?P<text>[^}]*))?\})")


def interpolate(value: Any, environment: Mapping[str, str]) -> Any:
    """`value` with `$NAME`, `${NAME-default}` and `${NAME?message}` replaced in every string, as Compose does.

    With a colon (`:-`, `:?`) an empty variable counts as missing. `$$` is a dollar sign.

    Raises:
        ComposeError: a required variable is missing.
    """

    def fill(found: re.Match[str]) -> str:
        if found.group() == "$$":
            return "$"
        name, rule = found["plain"] or found["name"], found["rule"] or "-"
        given = environment.get(name)
        if given is not None and (given or ":" not in rule):
            return given
        if rule.endswith("?"):
            raise ComposeError(f"required variable {name} is missing: {found['text']}")
        return found["text"] or ""

    if isinstance(value, str):
        return VARIABLE.sub(fill, value)
    if isinstance(value, list):
        return [interpolate(item, environment) for item in value]
    if isinstance(value, dict):
        return {key: interpolate(item, environment) for key, item in value.items()}
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value
