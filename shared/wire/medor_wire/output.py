"""What the services say: one log file per process, and one terminal for all of them with a coloured name in front."""

import contextlib
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Self, TextIO

from rich.console import Console
from rich.text import Text

COLOURS = ("cyan", "green", "yellow", "magenta", "blue", "bright_cyan", "bright_green", "bright_magenta")


class Output:
    """Sorts lines by process. The previous run's files are kept as `<name>.log.1`."""

    def __init__(self, folder: Path, *, echo: bool, console: Console | None = None) -> None:
        self.folder = folder
        self.echo = echo
        self.console = console or Console(stderr=True)
        self._files: dict[str, TextIO] = {}
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        self.folder.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            for file in self._files.values():
                file.close()
            self._files.clear()

    def line(self, name: str, text: str) -> None:
        """One line of one process."""
        with self._lock:
            file = self._files.get(name) or self._begin(name)
            line = Text.from_ansi(text)
            file.write(line.plain + "\n")
            if self.echo:
                colour = COLOURS[list(self._files).index(name) % len(COLOURS)]
                self.console.print(Text(f"{name:>10} | ", style=colour) + line, soft_wrap=True)

    def say(self, text: str) -> None:
        """A word of the launcher itself."""
        self.console.print(text, style="bold", soft_wrap=True)

    def _begin(self, name: str) -> TextIO:
        path = self.folder / f"{name}.log"
        if path.exists():
            path.replace(path.with_suffix(".log.1"))
        return self._files.setdefault(name, path.open("w", buffering=1))

    @contextlib.contextmanager
    def progress(self) -> Iterator[Callable[[str], None]]:
        """Shows the latest message: one living line on a terminal, a new line per new message elsewhere."""
        if self.console.is_terminal:
            with self.console.status("") as status:
                yield status.update
        else:
            shown = [""]

            def show(message: str) -> None:
                if message != shown[0]:
                    shown[0] = message
                    self.console.print(message, soft_wrap=True)

            yield show
