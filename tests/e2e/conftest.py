"""The whole simulated cell as a user gets it: one for all end-to-end tests, started from compose.yaml."""

from collections.abc import Iterator

import httpx
import pytest

from medor_wire.launcher import Launcher


@pytest.fixture(scope="session")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launcher]:
    with Launcher("sim", logs=tmp_path_factory.mktemp("logs"), echo=False) as cell:
        cell.wait_ready(300)  # the very first start compiles kernels
        yield cell


@pytest.fixture(scope="session")
def door(cell: Launcher) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=cell.url, timeout=120) as door:
        yield door
