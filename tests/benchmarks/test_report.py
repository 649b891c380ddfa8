"""The write-up: all figures as JSON, Markdown and a page that stands alone."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from benchmarks.findings import Findings
from benchmarks.pictures import path
from benchmarks.report import page
from benchmarks.results import Missing, Results
from benchmarks.run import Options, main
from medor_cloth.picture import png_bytes
from tests.benchmarks.made_up import lines, trial

MADE = {"date": "today", "command": "python -m benchmarks.run <&>"}
VOID = {"meta", "img", "br"}


class Tags(HTMLParser):
    """Checks that tags close in the order they opened."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Two results folders that share an episode, the second with a picture and something missing."""
    one, other = tmp_path / "one", tmp_path / "other"
    for folder, second in ((one, "random"), (other, "visible")):
        folder.mkdir()
        last = 0.9 if folder is one else 0.1
        Results(folder / "picks.jsonl").append(lines(trial(), [0.0, last]) + lines(trial(second), [0.0, -0.5, 0.2]))
    picture = path(other, trial().key)
    picture.parent.mkdir(parents=True)
    picture.write_bytes(png_bytes([[[1, 2, 3]]]))  # type: ignore[arg-type]
    absent = {trial("medor", state=state).key: "bad_request: no `weights` <here>" for state in range(2)}
    Missing(other / "missing.json").keep({**absent, trial().key: "long since run"})
    return one, other


def found(folders: tuple[Path, ...]) -> Findings:
    return Findings.of(folders, 10, "drop", MADE)


def test_of_an_episode_in_two_folders_that_of_the_first_counts(folders: tuple[Path, Path]) -> None:
    assert [row.ni for row in found(folders).rows] == pytest.approx([0.9, 0.2, 0.2])
    assert found(folders[::-1]).rows[0].ni == pytest.approx(0.1)


def test_what_is_missing_is_told_by_method_and_what_is_there_is_not_missing(folders: tuple[Path, Path]) -> None:
    findings = found(folders)
    assert findings.refusals == {"medor": "2 episodes, bad_request: no `weights` <here>"}
    assert "no `weights` <here>" in findings.as_markdown()


def test_every_figure_of_the_tables_is_in_the_json(folders: tuple[Path, Path]) -> None:
    findings = found(folders)
    content = json.loads(findings.as_json())
    assert [(row["label"], row["ni"]) for row in content["ablation"]] == [
        (row.variant.label, row.ni) for row in findings.rows
    ]
    assert content["ablation"][0]["published"] == {"row": "GT mesh, GT dynamics", "ni": 0.870, "spread": 0.076}
    for row in content["by_category"]:
        assert f"| {row['ni']['10']['median']:.2f} (" in findings.as_markdown()
    assert content["made"]["command"] == MADE["command"]


def test_the_page_is_well_formed_and_needs_nothing_else(folders: tuple[Path, Path]) -> None:
    text = page(found(folders))
    tags = Tags()
    tags.feed(text)
    assert tags.open == []
    assert len(tags.sources) == 1
    assert tags.sources[0].startswith("data:image/png;base64,")
    assert not re.search(r"https?://", text)
    assert "benchmarks.run &lt;&amp;&gt;" in text


def test_the_page_draws_every_method_in_every_plot(folders: tuple[Path, Path]) -> None:
    text = page(found(folders))
    assert text.count("<polyline") == 3 * 2  # all categories, and tshirt alone
    assert re.findall(r"<text class=name[^>]*>([^<]+)", text) == ["oracle", "visible", "random"]


def test_writing_up_needs_no_cell_and_changes_no_results(folders: tuple[Path, Path], tmp_path: Path) -> None:
    before = [(folder / "picks.jsonl").read_bytes() for folder in folders]
    assert main(Options(report_only=True, out=tmp_path / "new", also=folders)) == 0
    assert sorted(file.name for file in (tmp_path / "new").iterdir()) == ["report.html", "table.json", "table.md"]
    assert [(folder / "picks.jsonl").read_bytes() for folder in folders] == before


def test_nothing_to_write_up_is_no_error(tmp_path: Path) -> None:
    assert main(Options(report_only=True, out=tmp_path)) == 0
