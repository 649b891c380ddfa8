"""An interactive page that shows cloth, by viser (extra `medor-cloth[viewer]`)."""

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from medor_cloth.errors import ClothError
from medor_cloth.footage import Footage
from medor_cloth.portrait import INSIDE_RGB, LINES_M, OUTSIDE_RGB, vertex_normals

FRAMES_A_SECOND = 10.0
"""Default pace of what is no motion."""
INSIDE_OFFSET_M = 0.0003
"""The inner side is drawn this far behind the outer one, or the two would flicker."""


def perform(footage: Footage, port: int, ended: threading.Event | None = None) -> None:
    """Serves a page on loopback until it is told to end or interrupted: turn the cloth, play its states.

    Args:
        footage: What to show.
        port: Of the page.
        ended: Set by whoever wants it to end.

    Raises:
        ClothError: viser is not installed.
    """
    try:
        import viser  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ClothError("the interactive page needs the extra: pip install 'medor-cloth[viewer]'") from error
    server = viser.ViserServer(host="127.0.0.1", port=port, label=footage.name)
    try:
        Stage(server, footage).play(ended or threading.Event())
    finally:
        server.stop()


class Stage:
    """The cloth on a page and the knobs beside it.

    Args:
        server: A `viser.ViserServer`.
        footage: What it shows.
    """

    def __init__(self, server: Any, footage: Footage):
        self._server, self._footage = server, footage
        server.scene.set_up_direction("+z")
        if not footage.worn:
            server.scene.add_grid("/table", width=1.0, height=1.0, cell_size=LINES_M, section_size=10 * LINES_M)
        last = len(footage.states) - 1
        gui = server.gui
        gui.add_markdown(f"**{footage.name}**  \n{footage.summary}")
        self._frame = gui.add_slider("state", 0, max(last, 1), 1, 0, disabled=last == 0)
        self._playing = gui.add_checkbox("play", last > 0, disabled=last == 0)
        pace = 1 / footage.seconds if footage.seconds else FRAMES_A_SECOND
        self._pace = gui.add_slider("states a second", 0.5, 60.0, 0.5, min(max(pace / 2, 0.5), 60.0))
        self._wires = gui.add_checkbox("edges", False)
        self._frame.on_update(lambda _: self.show())
        self._wires.on_update(lambda _: self.show())
        self.show()

    def show(self) -> None:
        """Draws the state the slider is at."""
        state = self._footage.states[min(int(self._frame.value), len(self._footage.states) - 1)]
        for name, faces, colour, vertices in _sides(state, self._footage.faces):
            self._server.scene.add_mesh_simple(
                name, vertices, faces, color=colour, side="front", flat_shading=False, wireframe=self._wires.value
            )

    def play(self, ended: threading.Event) -> None:
        """Steps through the states while the box is ticked, until told to end."""
        while not ended.wait(1 / self._pace.value):
            if self._playing.value:
                self._frame.value = (int(self._frame.value) + 1) % len(self._footage.states)
                self.show()


def _sides(state: NDArray[np.float32], faces: NDArray[np.int32]):
    """(name, faces, colour, vertices) of the outer side and of the inner one, whose faces are wound the other way."""
    inner = state - INSIDE_OFFSET_M * vertex_normals(state, faces).astype(np.float32)
    yield "/cloth/outside", faces, tuple(OUTSIDE_RGB.astype(int).tolist()), state
    yield "/cloth/inside", faces[:, ::-1], tuple(INSIDE_RGB.astype(int).tolist()), inner
