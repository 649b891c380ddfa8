"""Settings: trusted defaults, then the environment, then the command line; typos are errors."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from medor_wire.config import BusConfig, Settings, UnknownSetting


class Example(Settings, section="example"):
    """An example."""

    threads: int = 1
    """How many."""
    engine: str = "xpbd"
    state: Path = Path("state")
    sizes: tuple[int, ...] = (1, 2)
    limit: float | None = None
    dry: bool = False


def test_defaults_stand_without_anything() -> None:
    assert Example.from_environment({}) == Example()


def test_the_environment_overrides_defaults() -> None:
    config = Example.from_environment(
        {
            "MEDOR_EXAMPLE__THREADS": "4",
            "MEDOR_EXAMPLE__STATE": "/tmp/x",
            "MEDOR_EXAMPLE__SIZES": "[3, 4, 5]",
            "MEDOR_EXAMPLE__LIMIT": "0.5",
            "MEDOR_EXAMPLE__DRY": "true",
            "MEDOR_BUS__ID": "example-2",
            "MEDOR_BUS__SHARED_MEMORY": "0",
            "MEDOR_OTHER__ENGINE": "ignored",
            "PATH": "ignored",
        }
    )
    assert config == Example(
        threads=4,
        state=Path("/tmp/x"),
        sizes=(3, 4, 5),
        limit=0.5,
        dry=True,
        bus=BusConfig(id="example-2", shared_memory=False),
    )


def test_the_command_line_overrides_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MEDOR_EXAMPLE__THREADS", "4")
    monkeypatch.setenv("MEDOR_EXAMPLE__ENGINE", "bullet")
    monkeypatch.setenv("MEDOR_BUS__CELL", "north")
    config = Example.from_command_line(["--threads", "8", "--bus.router", "tcp/10.0.0.5:7447"])
    assert (config.threads, config.engine) == (8, "bullet")
    assert config.bus == BusConfig(cell="north", router="tcp/10.0.0.5:7447")


def test_help_shows_what_a_field_means(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        Example.from_command_line(["--help"])
    assert "How many." in capsys.readouterr().out


@pytest.mark.parametrize("variable", ["MEDOR_EXAMPLE__THREAD", "MEDOR_BUS__ROUTERS"])
def test_a_variable_that_sets_nothing_is_an_error(variable: str) -> None:
    with pytest.raises(UnknownSetting, match=variable):
        Example.from_environment({variable: "1"})


@pytest.mark.parametrize("value", ["many", "1.5", ""])
def test_a_value_of_the_wrong_type_is_an_error(value: str) -> None:
    with pytest.raises(ValidationError, match="threads"):
        Example.from_environment({"MEDOR_EXAMPLE__THREADS": value})


@pytest.mark.parametrize("name", ["a/b", "*", "a b ", "$", "@x"])
def test_names_on_the_bus_are_one_plain_word(name: str) -> None:
    with pytest.raises(ValidationError, match="plain name"):
        BusConfig(id=name)
