"""Messages as bytes: `u32 header length | header | raw arrays, each on a 64-byte boundary`.

The header is two msgpack objects: what the frame is, with the table of its arrays (dtype and shape), and the message
as plain data, in which an array stands as a numbered reference. The arrays follow in the order of the table without
gaps other than the padding, so that nothing can overlap or point outside. `bytes` fields travel like arrays. Nothing
is ever unpickled.
"""

import math
import struct
from typing import Any, TypeVar

import msgpack
import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from medor_wire.errors import BadFrame, BadVersion
from medor_wire.messages import Message

Content = TypeVar("Content", bound=Message)
Buffer = bytes | bytearray | memoryview

FORMAT = 1
"""Major version of the frame's layout."""
MAX_FRAME = 64 << 20
MAX_HEADER = 1 << 20
MAX_ARRAYS = 4096
ALIGNMENT = 64
DTYPES = frozenset({"<f4", "<f8", "<i4", "<i8", "<u2", "<u4", "|u1", "|i1", "|b1"})
ARRAY, BYTES = 1, 2
"""msgpack extension types: reference to an array, reference to a byte string."""
MALFORMED = (LookupError, ValueError, TypeError, AttributeError, RecursionError, struct.error, msgpack.UnpackException)
"""What reading arbitrary bytes may raise."""


def encode(message: Message) -> bytes:
    """`message` as one frame.

    Raises:
        BadFrame: an array's dtype may not travel, or the frame is larger than a peer would accept.
    """
    arrays: list[NDArray[Any]] = []
    content = _pack(_plain(message, arrays))
    about = {"format": FORMAT, "schema": type(message).__name__, "version": message.VERSION}
    header = _pack(about | {"arrays": [(array.dtype.str, array.shape) for array in arrays]}) + content
    pieces: list[Any] = [struct.pack("<I", len(header)), header, bytes(_padding(4 + len(header)))]
    for array in arrays:
        if array.dtype.str not in DTYPES:
            raise BadFrame(f"arrays of dtype {array.dtype} do not travel; expected one of {sorted(DTYPES)}")
        pieces += (array, bytes(_padding(array.nbytes)))
    frame = b"".join(pieces)
    if len(frame) > MAX_FRAME or len(header) > MAX_HEADER or len(arrays) > MAX_ARRAYS:
        raise BadFrame(f"{type(message).__name__} is too large to travel: {len(frame)} bytes, {len(arrays)} arrays")
    return frame


def decode(expected: type[Content], frame: Buffer, *, max_bytes: int = MAX_FRAME) -> Content:
    """The message in `frame`; its arrays are read-only views of it.

    Raises:
        BadVersion: a frame or a message of another major version.
        BadFrame: anything else that is not a valid frame of that message.
    """
    try:
        return expected.model_validate(_content(expected, frame, max_bytes))
    except ValidationError as error:
        raise BadFrame(f"not a valid {expected.__name__}: {_first_fault(error)}") from None
    except MALFORMED as fault:
        raise BadFrame(f"not a frame of {expected.__name__}: {type(fault).__name__} {fault}") from None


def _content(expected: type[Message], frame: Buffer, max_bytes: int) -> Any:
    """The message as plain data and views, nothing of it validated yet."""
    if not 4 <= len(frame) <= max_bytes:
        raise BadFrame(f"expected a frame of 4 to {max_bytes} bytes, got {len(frame)}")
    (size,) = struct.unpack_from("<I", frame)
    if size > min(len(frame) - 4, MAX_HEADER):
        raise BadFrame(f"header of {size} bytes in a frame of {len(frame)}")
    table: list[NDArray[Any]] = []
    header = msgpack.Unpacker(ext_hook=lambda kind, which: _resolve(kind, which, table), max_buffer_size=MAX_HEADER)
    header.feed(memoryview(frame)[4 : 4 + size])
    about = header.unpack()
    _check_schema(expected, about)
    table += _views(about["arrays"], frame, _aligned(4 + size))
    return header.unpack()


def _check_schema(expected: type[Message], about: dict[str, Any]) -> None:
    if about["format"] != FORMAT:
        raise BadVersion(f"frame format {about['format']}, expected {FORMAT}")
    if about["schema"] != expected.__name__:
        raise BadFrame(f"expected a frame of {expected.__name__}, got {str(about['schema'])[:60]}")
    if about["version"] != expected.VERSION:
        raise BadVersion(f"{expected.__name__} version {about['version']}, expected {expected.VERSION}")


def _views(table: list[tuple[str, list[int]]], frame: Buffer, start: int) -> list[NDArray[Any]]:
    """The arrays behind the header; together they must fill the frame exactly."""
    if len(table) > MAX_ARRAYS:
        raise BadFrame(f"{len(table)} arrays, at most {MAX_ARRAYS} are read")
    views = []
    for dtype, shape in table:
        if dtype not in DTYPES or not all(type(n) is int and n >= 0 for n in shape):
            raise BadFrame(f"array of dtype {str(dtype)[:20]} and shape {str(shape)[:60]}")
        count = math.prod(shape)
        end = start + count * np.dtype(dtype).itemsize
        if end > len(frame):
            raise BadFrame(f"array of shape {tuple(shape)} ends at byte {end} of {len(frame)}")
        flat = np.frombuffer(frame, dtype, count, start) if count else np.empty(0, dtype)
        if dtype == "|b1" and count and flat.view(np.uint8).max() > 1:
            raise BadFrame("booleans other than 0 and 1")
        views.append(flat.reshape(shape))
        start = _aligned(end)
    if start != len(frame):
        raise BadFrame(f"{len(frame)} bytes, {start} expected from the table of arrays")
    return views


def _resolve(kind: int, which: bytes, table: list[NDArray[Any]]) -> Any:
    """What a reference stands for."""
    (index,) = struct.unpack("<H", which)
    if kind not in (ARRAY, BYTES) or index >= len(table):
        raise ValueError(f"reference of kind {kind} to array {index} of {len(table)}")
    return table[index].tobytes() if kind == BYTES else table[index]


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """`value` as what msgpack can hold; its arrays are appended to `arrays`."""
    if isinstance(value, np.ndarray):
        return _refer(ARRAY, np.ascontiguousarray(value).reshape(value.shape), arrays)
    if isinstance(value, bytes):
        return _refer(BYTES, np.frombuffer(value, np.uint8), arrays)
    if isinstance(value, Message):
        return {name: _plain(getattr(value, name), arrays) for name in type(value).model_fields}
    if isinstance(value, list | tuple):
        return [_plain(item, arrays) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item, arrays) for key, item in value.items()}
    return value


def _refer(kind: int, array: NDArray[Any], arrays: list[NDArray[Any]]) -> msgpack.ExtType:
    arrays.append(array)
    return msgpack.ExtType(kind, struct.pack("<H", len(arrays) - 1))


def _pack(content: Any) -> bytes:
    return msgpack.Packer().pack(content)


def _aligned(offset: int) -> int:
    return -(-offset // ALIGNMENT) * ALIGNMENT


def _padding(size: int) -> int:
    return _aligned(size) - size


def _first_fault(error: ValidationError) -> str:
    fault = error.errors(include_url=False, include_context=False, include_input=False)[0]
    return f"{'.'.join(map(str, fault['loc']))} {fault['msg']}".strip()
