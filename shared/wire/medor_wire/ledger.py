"""At most once: every action is written down before it moves anything, and its outcome after.

A durable table (sqlite, WAL, synchronous FULL) at the cell. The same `action_id` again gets the recorded outcome and
moves nothing. An action that was running when the process died may or may not have happened: it is never run again.
"""

import hashlib
import sqlite3
import threading
from collections.abc import Callable
from pathlib import Path

from medor_wire.codec import decode, encode
from medor_wire.errors import Busy, IdReused, MedorError, OutcomeUnknown, error_from
from medor_wire.messages import ActOutcome, ActRequest

SCHEMA = """
create table if not exists actions (
    id text primary key,
    content blob not null,
    state text not null check (state in ('executing', 'done', 'failed', 'unknown')),
    outcome blob,
    code text,
    message text
) strict;
create table if not exists facts (name text primary key, value text not null) strict;
update actions set state = 'unknown' where state = 'executing';
"""


class Ledger:
    """The actions of one cell. One process owns the file as long as it is open."""

    def __init__(self, path: Path) -> None:
        """Open or create the ledger; what was executing when its last owner died becomes unknown.

        Raises:
            Busy: another process has it open.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.RLock()
        self._db = sqlite3.connect(path, check_same_thread=False, isolation_level=None, timeout=0.5)
        try:
            # An exclusive owner: a second cell on the same file would take live actions for abandoned ones.
            for pragma in ("locking_mode = exclusive", "journal_mode = wal", "synchronous = full"):
                self._db.execute(f"pragma {pragma}")
            self._db.executescript(f"begin immediate; {SCHEMA} commit;")
        except sqlite3.OperationalError as error:
            self._db.close()
            raise Busy(f"the ledger {path} belongs to another process: {error}") from error

    def once(self, request: ActRequest, act: Callable[[], ActOutcome]) -> ActOutcome:
        """The outcome of `request`, running `act` only if this action id was never seen.

        Raises:
            IdReused: the id was seen with another pick, place or executor.
            OutcomeUnknown: the action was interrupted by a crash; look again before acting.
            Busy: the action is running at this moment.
            MedorError: what `act` raised, now or when it ran.
        """
        if (recorded := self._begin(request)) is not None:
            return recorded
        try:
            outcome = act()
        except MedorError as error:
            self._end(request.action_id, "failed", code=error.code, message=str(error))
            raise
        except BaseException:
            self._end(request.action_id, "unknown")
            raise
        self._end(request.action_id, "done", outcome=encode(outcome))
        return outcome

    def next_epoch(self) -> int:
        """A fencing epoch larger than all before it, those of earlier processes included."""
        with self._lock:
            epoch = int(self.fact("epoch") or 0) + 1
            self.record("epoch", str(epoch))
            return epoch

    def fact(self, name: str) -> str | None:
        """What was recorded under `name`."""
        with self._lock:
            row = self._db.execute("select value from facts where name = ?", (name,)).fetchone()
        return row[0] if row else None

    def record(self, name: str, value: str | None) -> None:
        """Write a fact down, or strike it out with None."""
        with self._lock:
            if value is None:
                self._db.execute("delete from facts where name = ?", (name,))
            else:
                self._db.execute("insert or replace into facts values (?, ?)", (name, value))

    def close(self) -> None:
        with self._lock:
            self._db.close()

    def _begin(self, request: ActRequest) -> ActOutcome | None:
        """None when the action is new: it is then durably `executing`."""
        content = _digest(request)
        with self._lock:
            row = self._db.execute(
                "select content, state, outcome, code, message from actions where id = ?", (request.action_id,)
            ).fetchone()
            if row is None:
                self._db.execute(
                    "insert into actions (id, content, state) values (?, ?, 'executing')", (request.action_id, content)
                )
                return None
        return _recorded(request, content, *row)

    def _end(
        self, action_id: str, state: str, *, outcome: bytes | None = None, code: str | None = None, message: str = ""
    ) -> None:
        with self._lock:
            self._db.execute(
                "update actions set state = ?, outcome = ?, code = ?, message = ? where id = ?",
                (state, outcome, code, message, action_id),
            )


def _recorded(
    request: ActRequest, content: bytes, seen: bytes, state: str, outcome: bytes, code: str, message: str
) -> ActOutcome:
    if seen != content:
        raise IdReused(f"action {request.action_id} was asked before with another pick, place or executor")
    if state == "executing":
        raise Busy(f"action {request.action_id} is running")
    if state == "unknown":
        raise OutcomeUnknown(f"action {request.action_id} was interrupted; it may or may not have moved the cloth")
    if state == "failed":
        raise error_from(code, message)
    return decode(ActOutcome, outcome).model_copy(update={"replayed": True})


def _digest(request: ActRequest) -> bytes:
    """Of what the action does; the epoch may differ when a new holder repeats it."""
    content = request.pick.tobytes() + request.place.tobytes()
    if request.executor != "picker":  # as before there were others, so that older ledgers stay valid
        content += request.executor.encode()
    return hashlib.sha256(content).digest()
