"""One shard filled by several processes, garment by garment."""

import multiprocessing
import signal
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from multiprocessing.sharedctypes import Synchronized

from medor_cloth.errors import ClothError, DatasetError
from medor_sim.collect.collector import collect
from medor_sim.collect.shard import Shard

_SPAWN = multiprocessing.get_context("spawn")


def collect_in_processes(shard: Shard, garments: Sequence[int], workers: int, written: Callable[[int], None]) -> None:
    """Fills an opened shard; the data does not depend on the number of workers.

    Args:
        shard: Opened by the caller.
        garments: Which of its garments.
        workers: Processes.
        written: Told the id of each trajectory once it is on disk.

    Raises:
        DatasetError: a worker failed or died. What was complete stays so.
    """
    following = _SPAWN.Value("q", 0)
    running: dict[Connection, SpawnProcess] = {}
    try:
        for _ in range(min(workers, len(garments))):
            ours, theirs = _SPAWN.Pipe(duplex=False)
            process = _SPAWN.Process(target=_work, args=(shard, garments, following, theirs), daemon=True)
            process.start()
            theirs.close()
            running[ours] = process
        while running:
            for connection in wait(list(running)):
                assert isinstance(connection, Connection)
                if not _read(connection, written):
                    _end(running.pop(connection))
    finally:
        for process in running.values():
            process.terminate()
            process.join()


def _read(connection: Connection, written: Callable[[int], None]) -> bool:
    """Takes one report; False when the worker has closed its end."""
    try:
        message = connection.recv()
    except EOFError:
        return False
    if isinstance(message, str):
        raise DatasetError(message)
    written(message)
    return True


def _end(process: SpawnProcess) -> None:
    process.join()
    if process.exitcode:
        raise DatasetError(f"a worker died (exit code {process.exitcode}); run the same command again to go on")


def _work(shard: Shard, garments: Sequence[int], following: "Synchronized[int]", parent: Connection) -> None:
    """A worker's life: takes the next garment until none is left. Ends by itself when its parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent ends us

    def taken():
        while True:
            with following.get_lock():
                index, following.value = following.value, following.value + 1
            if index >= len(garments):
                return
            yield garments[index]

    try:
        for number in collect(shard, taken()):
            parent.send(number)
    except ClothError as error:
        parent.send(str(error))
    except BrokenPipeError:  # the parent was killed: what is written stays
        return
