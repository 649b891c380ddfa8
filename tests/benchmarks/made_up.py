"""Results files of episodes that never were."""

from benchmarks.episodes import Episode, episodes
from benchmarks.protocol import Trial
from benchmarks.results import Line


def lines(trial: Trial, ni: list[float], **last: str) -> list[Line]:
    """Of an episode that reached these values after 0, 1, … picks."""
    return [
        {
            "key": trial.key,
            "method": trial.label,
            "category": trial.category,
            "task": trial.task,
            "state": trial.state,
            "pick": pick,
            "ni": value,
            "seconds": 1.0 + pick,
            "last": pick == len(ni) - 1,
            **(last if pick == len(ni) - 1 else {}),
        }
        for pick, value in enumerate(ni)
    ]


def trial(method: str = "oracle", category: str = "tshirt", task: str = "flatten", state: int = 0, **other) -> Trial:
    return Trial(method, category, task, state, "drop", **{"picks": 10, "candidates": 100, **other})  # pyright: ignore


def steady(ni: float, **what) -> Episode:
    """An episode that reached `ni` with its first pick and stayed there."""
    return episodes(lines(trial(**what), [0.0] + 10 * [ni]), 10)[0]
