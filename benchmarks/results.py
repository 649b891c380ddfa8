"""The results file: one JSON line per pick, appended as picks end; an episode counts when its last line is there."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Line = dict[str, Any]


@dataclass(frozen=True)
class Results:
    """Lines in `path`. A killed run leaves an episode without its `last` line: it is run again from its start."""

    path: Path

    def lines(self) -> list[Line]:
        """Every line of a finished episode; a torn last line is dropped."""
        if not self.path.exists():
            return []
        parsed = [line for text in self.path.read_text().splitlines() if (line := _parse(text)) is not None]
        finished = {line["key"] for line in parsed if line["last"]}
        return [line for line in parsed if line["key"] in finished]

    def finished(self) -> set[str]:
        return {line["key"] for line in self.lines()}

    def keep_finished(self) -> None:
        """Rewrite the file without the lines of unfinished episodes."""
        kept = self.lines()
        self.path.parent.mkdir(parents=True, exist_ok=True)
        fresh = self.path.with_suffix(".tmp")
        fresh.write_text("".join(json.dumps(line) + "\n" for line in kept))
        fresh.replace(self.path)

    def append(self, lines: Iterable[Line]) -> None:
        with self.path.open("a") as file:
            for line in lines:
                file.write(json.dumps(line) + "\n")
            file.flush()


@dataclass(frozen=True)
class Missing:
    """Why episodes that were asked for are not among the results: one JSON object in `path`, by key."""

    path: Path

    def keep(self, reasons: dict[str, str]) -> None:
        self.path.write_text(json.dumps(reasons, indent=1) + "\n")

    def reasons(self) -> dict[str, str]:
        return json.loads(self.path.read_text()) if self.path.exists() else {}


def _parse(text: str) -> Line | None:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return None
