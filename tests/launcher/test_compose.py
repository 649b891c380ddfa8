"""compose.yaml as the launcher reads it: profiles, replicas and variables mean what they mean to Docker Compose."""

from pathlib import Path

import pytest

from medor_wire.compose import ComposeError, find, interpolate, read, replicas

COMPOSE = """
x-common: &common
  restart: unless-stopped
services:
  recon:
    <<: *common
    command: [python, -m, medor_recon.serve]
    environment: {MEDOR_BUS__ROUTER: "tcp/router:7447", MEDOR_RECON__DEVICE: "${DEVICE:-auto}"}
  dynamics:
    <<: *common
    command: [python, -m, medor_dynamics.serve]
    deploy: {replicas: "${REPLICAS:-2}"}
    environment: {MEDOR_DYNAMICS__THREADS: 1}
  sim: {command: [python, -m, medor_sim.serve], profiles: [sim]}
  robot: {command: [python, -m, medor_robot.serve], profiles: [robot]}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "compose.yaml"
    path.write_text(COMPOSE)
    return path


def test_profile_swaps_sim_for_robot_and_changes_nothing_else(file: Path) -> None:
    services = read(file, {})
    simulated, real = replicas(services, "sim"), replicas(services, "robot")
    assert [r.name for r in simulated] == ["recon", "dynamics-1", "dynamics-2", "sim"]
    assert [r.name for r in real] == ["recon", "dynamics-1", "dynamics-2", "robot"]
    assert simulated[:3] == real[:3]


def test_unknown_profile_names_the_known_ones(file: Path) -> None:
    with pytest.raises(ComposeError, match="robot, sim"):
        replicas(read(file, {}), "moon")


def test_environment_decides_the_number_of_replicas(file: Path) -> None:
    assert len(replicas(read(file, {"REPLICAS": "5"}), "sim")) == 7
    assert [r.name for r in replicas(read(file, {"REPLICAS": "1"}), "sim")] == ["recon", "dynamics", "sim"]
    assert [r.name for r in replicas(read(file, {"REPLICAS": "0"}), "sim")] == ["recon", "sim"]


def test_environment_values_are_text(file: Path) -> None:
    services = read(file, {"DEVICE": "cuda"})
    assert services["dynamics"].environment == {"MEDOR_DYNAMICS__THREADS": "1"}
    assert services["recon"].environment["MEDOR_RECON__DEVICE"] == "cuda"


@pytest.mark.parametrize(
    ("text", "given", "filled"),
    [
        ("$A/${B}", {"A": "1", "B": "2"}, "1/2"),
        ("${A}", {}, ""),
        ("${A-d}", {"A": ""}, ""),
        ("${A:-d}", {"A": ""}, "d"),
        ("${A?say}", {"A": ""}, ""),
        ("cost: $$5", {}, "cost: $5"),
    ],
)
def test_variables_follow_the_rules_of_compose(text: str, given: dict[str, str], filled: str) -> None:
    assert interpolate({"key": [text]}, given) == {"key": [filled]}


@pytest.mark.parametrize(("text", "given"), [("${A?set it}", {}), ("${A:?set it}", {}), ("${A:?set it}", {"A": ""})])
def test_a_missing_required_variable_is_named_with_its_message(text: str, given: dict[str, str]) -> None:
    with pytest.raises(ComposeError, match="A is missing: set it"):
        interpolate(text, given)


@pytest.mark.parametrize(
    "content",
    ["services: [", "{}", "services: 3", "services: {recon: {image: x}}", "services: {recon: {command: []}}"],
)
def test_a_bad_file_is_refused_with_its_path(tmp_path: Path, content: str) -> None:
    path = tmp_path / "compose.yaml"
    path.write_text(content)
    with pytest.raises(ComposeError, match=r"compose\.yaml"):
        read(path, {})


def test_the_nearest_file_above_is_found(file: Path) -> None:
    deep = file.parent / "a" / "b"
    deep.mkdir(parents=True)
    assert find(deep) == file
