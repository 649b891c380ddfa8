"""The results file survives being killed at any byte."""

from pathlib import Path

from benchmarks.results import Results


def episode(key: str, picks: int) -> list[dict]:
    return [{"key": key, "pick": i, "last": i == picks} for i in range(picks + 1)]


def test_an_episode_counts_only_with_its_last_line(tmp_path: Path) -> None:
    results = Results(tmp_path / "picks.jsonl")
    results.append(episode("a", 3))
    results.append(episode("b", 3)[:-1])
    assert results.finished() == {"a"}
    assert len(results.lines()) == 4


def test_any_truncation_keeps_whole_episodes_only_and_can_be_continued(tmp_path: Path) -> None:
    whole = Results(tmp_path / "whole.jsonl")
    whole.append(episode("a", 2) + episode("b", 2))
    text = whole.path.read_text()
    for cut in range(0, len(text), 7):
        torn = Results(tmp_path / "torn.jsonl")
        torn.path.write_text(text[:cut])
        torn.keep_finished()
        missing = {"a", "b"} - torn.finished()
        torn.append([line for key in sorted(missing) for line in episode(key, 2)])
        assert sorted(torn.lines(), key=lambda x: (x["key"], x["pick"])) == whole.lines()


def test_a_missing_file_is_an_empty_one(tmp_path: Path) -> None:
    results = Results(tmp_path / "deep" / "picks.jsonl")
    results.keep_finished()
    assert results.lines() == []
