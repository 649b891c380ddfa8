"""Which episodes a benchmark runs: methods x categories x tasks x held-out states, each with fixed seeds."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, Self, get_args

from medor_wire.messages import Category, EpisodeRequest, Executor, ResetRequest, StartState, Task

HELD_OUT_SEED = 800_000
"""First garment seed that nothing is ever trained on."""

Engine = Literal["xpbd", "bullet"]
"""What moves the cloth in the simulated cell (`MEDOR_SIM__ENGINE`)."""

KEY = re.compile(
    r"(?P<method>[^/]+)/(?P<category>[a-z]+)/(?P<task>[a-z]+)/(?P<start>[a-z]+)(?P<state>\d+)"
    r"/p(?P<picks>\d+)/k(?P<candidates>\d+)(?P<unusual>(/[^/]+)*)"
)


@dataclass(frozen=True)
class Trial:
    """One closed-loop episode of the protocol."""

    method: str
    category: Category
    task: Task
    state: int
    start: StartState
    picks: int
    candidates: int
    executor: Executor = "picker"
    engine: Engine = "xpbd"
    softness: float = 1.0
    exhaustive: bool = False

    @property
    def key(self) -> str:
        """Names the trial in the results file; the same key is never run twice into one file."""
        key = f"{self.method}/{self.category}/{self.task}/{self.start}{self.state}/p{self.picks}/k{self.candidates}"
        return "/".join([key, *self.unusual])

    @classmethod
    def of(cls, key: str) -> Self:
        """The trial that a key names.

        Raises:
            ValueError: not a key of a trial.
        """
        match = KEY.fullmatch(key)
        if match is None:
            raise ValueError(f"expected method/category/task/start and state/p picks/k candidates, got {key!r}")
        fields: dict[str, Any] = match.groupdict()
        for name in ("state", "picks", "candidates"):
            fields[name] = int(fields[name])
        for word in filter(None, fields.pop("unusual").split("/")):
            fields |= _unusual(word)
        return cls(**fields)

    @property
    def label(self) -> str:
        """The method, and what is not as usual about the cell."""
        return f"{self.method} ({', '.join(self.unusual)})" if self.unusual else self.method

    @property
    def unusual(self) -> list[str]:
        """Who picks when not the flying gripper, what moves the cloth when not our solver, how soft it is when not as
        usual, and whether no candidate is screened out."""
        usual = {"picker", "xpbd", "softness 1"}
        words = [it for it in (self.executor, self.engine, f"softness {self.softness:.3g}") if it not in usual]
        return words + ["exhaustive"] * self.exhaustive

    def request(self) -> EpisodeRequest:
        """Garment and crumple depend on the state alone, so that all methods and tasks meet the same states."""
        return EpisodeRequest(
            category=self.category,
            task=self.task,
            method=self.method,
            max_picks=self.picks,
            candidates=self.candidates,
            seed=self.state,
            executor=self.executor,
            exhaustive=self.exhaustive,
            reset=ResetRequest(
                category=self.category,
                garment_seed=HELD_OUT_SEED + self.state,
                state=self.start,
                seed=self.state,
            ),
        )


def _unusual(word: str) -> dict[str, Any]:
    """The field that a word of `Trial.unusual` sets."""
    if word in get_args(Executor):
        return {"executor": word}
    if word in get_args(Engine):
        return {"engine": word}
    if word == "exhaustive":
        return {"exhaustive": True}
    name, _, value = word.partition(" ")
    if name != "softness":
        raise ValueError(f"expected an executor, an engine, a softness or exhaustive, got {word!r}")
    return {"softness": float(value)}


def trials(
    methods: tuple[str, ...],
    categories: tuple[Category, ...],
    tasks: tuple[Task, ...],
    states: int,
    start: StartState,
    picks: int,
    candidates: int,
    executors: tuple[Executor, ...] = ("picker",),
    engine: Engine = "xpbd",
    softness: float = 1.0,
    exhaustive: bool = False,
) -> Iterator[Trial]:
    """State by state, so that an unfinished run has every method on the same first states."""
    cell = engine, softness, exhaustive
    for state in range(states):
        for category in categories:
            for task in tasks:
                for method in methods:
                    for executor in executors:
                        yield Trial(method, category, task, state, start, picks, candidates, executor, *cell)
