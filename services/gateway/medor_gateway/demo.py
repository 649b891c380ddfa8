"""One closed-loop episode through the HTTP door, watched live: `python -m medor_gateway.demo --url http://127.0.0.1:8080`.

Prints a line per pick and writes `episode.json` and a self-contained `report.html`.
"""

import io
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import trimesh
import tyro
from rich.console import Console
from rich.status import Status

from medor_cloth.camera import Camera
from medor_gateway.http_models import Candidate, EpisodeState, Observation, PickDetail, PickReport
from medor_gateway.report import Arrow, Report, Step, page
from medor_wire.messages import DEFAULT_METHOD, Category, DepthView, Task


@dataclass(frozen=True)
class Options:
    """Which garment to unfold, and how."""

    url: str = "http://127.0.0.1:8080"
    """A running gateway."""
    method: str = DEFAULT_METHOD
    category: Category = "tshirt"
    task: Task = "flatten"
    seed: int = 1
    """Of the garment, its crumple and the planner."""
    picks: int = 10
    """At most."""
    candidates: int = 100
    """Per pick."""
    exhaustive: bool = False
    """Roll all of them out, none screened out by a rougher model."""
    out: Path = Path("runs/demo")
    """Where `episode.json` and `report.html` are written."""
    key: str = ""
    """API key, when the gateway asks for one."""


def main(options: Options) -> int:
    """Run the episode; 0 when it ended as it should."""
    console = Console()
    headers = {"Authorization": f"Bearer {options.key}"} if options.key else {}
    try:
        with httpx.Client(base_url=options.url, timeout=60, headers=headers) as door:
            episode = _run(door, options, console)
            report = _report(door, episode, options)
    except httpx.HTTPStatusError as error:
        console.print(f"[red]{error.request.method} {error.request.url.path}: {_detail(error.response)}[/red]")
        return 1
    except httpx.TransportError as error:
        console.print(f"[red]no answer from {options.url}: {error}. Is it up? Try `medor up`.[/red]")
        return 1
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "episode.json").write_text(episode.model_dump_json(indent=2) + "\n")
    (options.out / "report.html").write_text(page(report))
    console.print(f"{episode.status}, NI {episode.ni or 0:.3f} after {len(episode.picks) - 1} picks", highlight=False)
    console.print(f"wrote {options.out / 'episode.json'} and {options.out / 'report.html'}", highlight=False)
    if episode.error:
        console.print(f"[red]{episode.error.detail}[/red]")
    return 0 if episode.status == "done" else 1


def _run(door: httpx.Client, options: Options, console: Console) -> EpisodeState:
    """Start the episode and follow it to its end; Ctrl-C cancels it."""
    started = door.post(
        "/episodes",
        json={
            "category": options.category,
            "task": options.task,
            "method": options.method,
            "max_picks": options.picks,
            "garment_seed": options.seed,
            "state": "drop",
            "seed": options.seed,
            "options": {"candidates": options.candidates, "exhaustive": options.exhaustive},
        },
    )
    started.raise_for_status()
    where = started.headers["location"]
    try:
        with console.status("crumpling a garment") as status:
            for name, data in _events(door, f"{where}/events"):
                _show(name, data, status, console)
    except KeyboardInterrupt:
        door.delete(where)
        console.print("cancelled")
    answer = door.get(where)
    answer.raise_for_status()
    return EpisodeState.model_validate_json(answer.content)


def _events(door: httpx.Client, path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Server-sent events as (name, data), to the end of the stream."""
    with door.stream("GET", path, timeout=None) as stream:
        stream.raise_for_status()
        name = ""
        for line in stream.iter_lines():
            field, _, value = line.partition(": ")
            if field == "event":
                name = value
            elif field == "data":
                yield name, json.loads(value)


def _show(name: str, data: dict[str, Any], status: Status, console: Console) -> None:
    if name == "progress":
        status.update(f"{data['stage']} {data['fraction']:.0%}")
    elif name == "pick":
        console.print(_line(PickReport.model_validate_json(json.dumps(data))), highlight=False, soft_wrap=True)


def _line(pick: PickReport) -> str:
    """`pick 3  coverage 512 cm²  NI 0.61  capture 0.1 s  …`."""
    what = "start " if pick.index == 0 else f"pick {pick.index:<2d}"
    stages = "  ".join(f"{stage} {ms / 1000:.1f} s" for stage, ms in pick.timings_ms.items() if ms >= 50)
    idle = "  (nothing better than waiting)" if pick.no_op else ""
    return f"{what} coverage {pick.coverage_m2 * 1e4:4.0f} cm²  NI {pick.ni:6.3f}  {stages}{idle}"


def _report(door: httpx.Client, episode: EpisodeState, options: Options) -> Report:
    steps = [_step(door, pick.url) for pick in episode.picks if pick.index > 0]
    last = door.get("/cell/observation", headers={"Accept": "application/json"})
    final = Observation.model_validate_json(last.content).view().depth if last.is_success else None
    facts = {
        "garment": f"{options.category}, seed {options.seed}",
        "task": options.task,
        "method": options.method,
        "candidates per pick": str(options.candidates),
        "ended": f"{episode.status}, {episode.reason or 'see error'}",
        "flat coverage": f"{(episode.flat_coverage_m2 or 0) * 1e4:.0f} cm²",
        "normalized improvement": f"{episode.ni or 0:.3f} after {len(steps)} picks",
    }
    start_ni = episode.picks[0].ni if episode.picks else 0.0
    return Report(f"Medor: {options.task} a {options.category}", facts, start_ni, steps, final)


def _step(door: httpx.Client, url: str) -> Step:
    answer = door.get(url)
    answer.raise_for_status()
    pick = PickDetail.model_validate_json(answer.content)
    if pick.observation is None or pick.plan is None:
        raise httpx.DecodingError(f"{url} came without observation and plan")
    view = pick.observation.view()
    mesh = _mesh(door, pick.plan.mesh.url)
    return Step(
        index=pick.index,
        depth=view.depth,
        camera=_camera(view),
        vertices=np.asarray(mesh.vertices, np.float32),
        edges=np.asarray(mesh.edges_unique, np.int32),
        candidates=[_arrow(candidate) for candidate in pick.plan.candidates],
        action=None if pick.pick is None or pick.place is None else Arrow(pick.pick, pick.place, pick.reward),
        no_op_reward=pick.no_op_reward,
        coverage_m2=pick.coverage_m2,
        ni=pick.ni,
        timings_ms=pick.timings_ms,
    )


def _camera(view: DepthView) -> Camera:
    info = view.camera
    return Camera(info.K, info.T_world_camera, info.width, info.height)


def _mesh(door: httpx.Client, url: str) -> trimesh.Trimesh:
    answer = door.get(url.replace(".glb", ".ply"))
    answer.raise_for_status()
    mesh = trimesh.load(io.BytesIO(answer.content), file_type="ply", process=False)
    if not isinstance(mesh, trimesh.Trimesh):
        raise httpx.DecodingError(f"{url} is not one mesh")
    return mesh


def _arrow(candidate: Candidate) -> Arrow:
    return Arrow(candidate.pick, candidate.place, candidate.reward)


def _detail(response: httpx.Response) -> str:
    try:
        return str(response.json()["detail"])
    except (ValueError, KeyError, httpx.ResponseNotRead):
        return f"HTTP {response.status_code}"


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, description=__doc__)))
