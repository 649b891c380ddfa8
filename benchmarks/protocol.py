"""Which episodes a benchmark runs: methods x categories x tasks x held-out states, each with fixed seeds."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from medor_wire.messages import Category, EpisodeRequest, Executor, ResetRequest, StartState, Task

HELD_OUT_SEED = 800_000
"""First garment seed that nothing is ever trained on."""

Engine = Literal["xpbd", "bullet"]
"""What moves the cloth in the simulated cell (`MEDOR_SIM__ENGINE`)."""


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

    @property
    def key(self) -> str:
        """Names the trial in the results file; the same key is never run twice into one file."""
        key = f"{self.method}/{self.category}/{self.task}/{self.start}{self.state}/p{self.picks}/k{self.candidates}"
        return "/".join([key, *self.unusual])

    @property
    def label(self) -> str:
        """The method, and what is not as usual about the cell."""
        return f"{self.method} ({', '.join(self.unusual)})" if self.unusual else self.method

    @property
    def unusual(self) -> list[str]:
        """Who picks when not the flying gripper, what moves the cloth when not our solver, how soft it is when not as
        usual."""
        usual = {"picker", "xpbd", "softness 1"}
        return [it for it in (self.executor, self.engine, f"softness {self.softness:.3g}") if it not in usual]

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
            reset=ResetRequest(
                category=self.category,
                garment_seed=HELD_OUT_SEED + self.state,
                state=self.start,
                seed=self.state,
            ),
        )


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
) -> Iterator[Trial]:
    """State by state, so that an unfinished run has every method on the same first states."""
    for state in range(states):
        for category in categories:
            for task in tasks:
                for method in methods:
                    for executor in executors:
                        yield Trial(method, category, task, state, start, picks, candidates, executor, engine, softness)
