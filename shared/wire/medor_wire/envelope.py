"""What accompanies a request outside its frame: who asks, which question it belongs to, until when."""

import time
from dataclasses import asdict, dataclass
from typing import Self

import msgpack

from medor_wire.errors import BadFrame, BadVersion

VERSION = 1


@dataclass(frozen=True)
class Envelope:
    """Attachment of a request."""

    ask: str
    """Unique per attempt: what a cancel message names."""
    request_id: str
    """Shared by everything that happens on behalf of one question."""
    finish_by: float
    """Seconds since the epoch; hosts keep their clocks within a fraction of a second of each other."""
    source: str
    """Presence of the asker."""

    def pack(self) -> bytes:
        return msgpack.Packer().pack(asdict(self) | {"version": VERSION})

    @classmethod
    def unpack(cls, attachment: bytes) -> Self:
        """Read an attachment; unknown fields are ignored.

        Raises:
            BadVersion: of another major version.
            BadFrame: not an envelope.
        """
        try:
            fields = dict(msgpack.unpackb(attachment))
            version, by = fields["version"], float(fields["finish_by"])
            names = {name: str(fields[name]) for name in ("ask", "request_id", "source")}
        except (msgpack.UnpackException, ValueError, TypeError, KeyError) as error:
            raise BadFrame(f"not an envelope: {type(error).__name__} {error}") from None
        if version != VERSION:
            raise BadVersion(f"envelope version {version}, expected {VERSION}")
        return cls(finish_by=by, **names)

    def deadline(self) -> float:
        """`finish_by` on this process' monotonic clock."""
        return time.monotonic() + self.finish_by - time.time()
