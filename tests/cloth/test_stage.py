import socket
import sys
import threading
import time
import urllib.request
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from medor_cloth.errors import ClothError
from medor_cloth.footage import Footage
from medor_cloth.stage import Stage, perform

from .sheets import sheet

VERTICES, FACES = sheet(4, 3)
FOOTAGE = Footage("pull", np.stack([VERTICES + np.float32(0.01 * k) for k in range(3)]), FACES, seconds=0.05)


class Page:
    """What a page shows, without a page."""

    def __init__(self):
        self.meshes: dict[str, Any] = {}
        knob = lambda value: SimpleNamespace(value=value, on_update=lambda _: None)  # noqa: E731
        self.scene = MagicMock()
        self.scene.add_mesh_simple = lambda name, vertices, faces, **looks: self.meshes.update(
            {name: (vertices, faces)}
        )
        self.gui = SimpleNamespace(
            add_markdown=lambda _: None,
            add_slider=lambda name, low, high, step, value, **_: knob(value),
            add_checkbox=lambda name, value, **_: knob(value),
        )


def test_playing_goes_through_the_states_and_begins_again():
    page, seen = Page(), []
    stage = Stage(page, FOOTAGE)
    ended = MagicMock()
    ended.wait = lambda _: seen.append(page.meshes["/cloth/outside"][0][0, 2]) or len(seen) > 4
    stage.play(ended)
    np.testing.assert_allclose(seen, [0, 0.01, 0.02, 0, 0.01], atol=1e-6)


def test_the_inner_side_is_the_outer_one_seen_from_behind():
    page = Page()
    Stage(page, FOOTAGE)
    (outer, faces), (inner, turned) = page.meshes["/cloth/outside"], page.meshes["/cloth/inside"]
    np.testing.assert_array_equal(turned[:, ::-1], faces)
    assert 0 < np.abs(outer - inner).max() < 0.001


def test_a_missing_viewer_is_asked_for_by_name(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(ClothError, match=r"medor-cloth\[viewer\]"):
        perform(FOOTAGE, 0)


def test_the_page_is_served_on_loopback_until_it_is_ended():
    pytest.importorskip("viser")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    ended = threading.Event()
    page = threading.Thread(target=perform, args=(FOOTAGE, port, ended), daemon=True)
    page.start()
    for _ in range(100):
        time.sleep(0.1)
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=5) as answer:
                assert answer.status == 200
                break
        except OSError:
            continue
    else:
        pytest.fail("no page")
    ended.set()
    page.join(10)
    assert not page.is_alive()
