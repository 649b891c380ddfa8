"""What the wire costs: `python -m benchmarks.wire`.

A depth image of 256 KB goes in and a mesh of 10,000 vertices comes out, through the router, each in a process of its
own; beside it, in the same run and with the same sizes, a raw TCP ping between two processes. Prints p50 and p99.
"""

import multiprocessing
import socket
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import tyro
import zenoh

from medor_wire import endpoints, examples
from medor_wire.bus import Call, join
from medor_wire.codec import encode
from medor_wire.config import BusConfig
from medor_wire.messages import DepthView, Reconstruction, ReconstructRequest
from medor_wire.zenoh_config import router_config

SPAWN = multiprocessing.get_context("spawn")
DEPTH_PX = 256
MESH_SIDE = 100


@dataclass(frozen=True)
class Options:
    """How often, and with what."""

    rounds: int = 500
    shared_memory: bool = True


def question() -> ReconstructRequest:
    """A depth image of 256 KB."""
    depth = np.full((DEPTH_PX, DEPTH_PX), 0.645, np.float32)
    camera = examples.camera().model_copy(update={"width": DEPTH_PX, "height": DEPTH_PX})
    return ReconstructRequest(view=DepthView(depth=depth, camera=camera), category="tshirt")


def answer() -> Reconstruction:
    """A mesh of 10,000 vertices and 19,602 faces."""
    mesh = examples.mesh(MESH_SIDE).model_copy(update={"canonical": None, "panel_uv": None})
    return Reconstruction(mesh=mesh, timings_ms={})


def route(address: str, shared_memory: bool, up: Connection) -> None:
    with zenoh.open(router_config(address, shared_memory=shared_memory)):
        up.send(True)
        up.recv()


def serve(config: BusConfig, up: Connection) -> None:
    reply = answer()

    def reconstruct(request: ReconstructRequest, call: Call) -> Reconstruction:
        return reply

    with join("recon", config) as bus:
        bus.serve(endpoints.RECONSTRUCT, reconstruct)
        bus.announce()
        up.send(True)
        up.recv()


def echo(up: Connection) -> None:
    """Reads the question's bytes and writes the answer's, without looking at them."""
    asked, reply = len(encode(question())), encode(answer())
    with socket.create_server(("127.0.0.1", 0)) as door:
        up.send(door.getsockname()[1])
        link, _ = door.accept()
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with link:
            while _received(link, asked):
                link.sendall(reply)


class Child:
    """A process that says when it is ready and ends when told."""

    def __init__(self, target: Callable[..., None], *args: Any) -> None:
        self.pipe, theirs = SPAWN.Pipe()
        self._process = SPAWN.Process(target=target, args=(*args, theirs), daemon=True)
        self._process.start()
        self.said = self.pipe.recv()

    def close(self) -> None:
        self.pipe.send(True)
        self._process.join(5)
        self._process.kill()


def time_wire(options: Options) -> np.ndarray:
    """Round trips over the whole stack: model in, model out [ms]."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        address = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    config = BusConfig(router=address, cell="bench", shared_memory=options.shared_memory, log="json")
    with closing(Child(route, address, options.shared_memory)), closing(Child(serve, config)), join("me", config) as me:
        request = question()
        return _timed(lambda: me.ask(endpoints.RECONSTRUCT, request), options.rounds)


def time_tcp(options: Options) -> np.ndarray:
    """Round trips of the same bytes over a bare socket [ms]."""
    child = Child(echo)
    asked, size = encode(question()), len(encode(answer()))
    with socket.create_connection(("127.0.0.1", child.said)) as link:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def ping() -> None:
            link.sendall(asked)
            _received(link, size)

        times = _timed(ping, options.rounds)
    child.close()
    return times


def _received(link: socket.socket, size: int) -> bool:
    buffer = memoryview(bytearray(size))
    while len(buffer) and (got := link.recv_into(buffer)):
        buffer = buffer[got:]
    return not len(buffer)


def _timed(action: Callable[[], object], rounds: int) -> np.ndarray:
    times = []
    for _ in range(rounds + rounds // 10):
        begun = time.perf_counter()
        action()
        times.append(1e3 * (time.perf_counter() - begun))
    return np.array(times[rounds // 10 :])


def main(options: Options) -> None:
    tcp, wire = time_tcp(options), time_wire(options)
    print(f"{len(encode(question()))} bytes in, {len(encode(answer()))} bytes out, {options.rounds} rounds")
    for name, times in (("raw TCP", tcp), ("wire", wire)):
        print(f"{name:8} p50 {np.percentile(times, 50):6.2f} ms   p99 {np.percentile(times, 99):6.2f} ms")
    print(f"ratio    p50 {np.percentile(wire, 50) / np.percentile(tcp, 50):6.1f}")


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
