"""Inputs, outputs and metadata of an ONNX file, read from its bytes without loading its weights.

An ONNX file is a ModelProto in the wire format of Protocol Buffers: fields of a number and a type each.
Source: onnx/onnx.proto of ONNX 1.16; Protocol Buffers, Encoding.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

_GRAPH, _METADATA = 7, 14
"""Fields of ModelProto."""
_NODE, _INITIALIZER, _INPUT, _OUTPUT = 1, 5, 11, 12
"""Fields of GraphProto."""
_DATA_TYPE, _TENSOR_NAME, _RAW_DATA = 2, 8, 9
"""Fields of TensorProto."""
_NODE_INPUT, _OPERATOR = 1, 4
"""Fields of NodeProto."""
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
"""Wire types."""

_Message = list[tuple[int, int | memoryview]]
"""Number and value of each field."""
Shape = tuple[int | None, ...]
"""Lengths of the axes, None where a length is free."""


@dataclass(frozen=True)
class Tensor:
    """An input or output of a model."""

    name: str
    shape: Shape
    element: int
    """Type of its numbers: 1 for float32, 7 for int64, 10 for float16."""

    def __str__(self) -> str:
        return f"{self.name} [{', '.join('?' if axis is None else str(axis) for axis in self.shape)}]"


@dataclass(frozen=True)
class OnnxHeader:
    """Inputs and outputs of a model, and its metadata by name."""

    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]
    metadata: dict[str, str]
    subtracted: float | None = None
    """Greatest number that the model itself subtracts from its first input; None where it begins otherwise."""


def parse_header(data: bytes) -> OnnxHeader:
    """The header of an ONNX file; ValueError where the bytes are none."""
    graphs, metadata = list[memoryview](), dict[str, str]()
    for field, value in _fields(memoryview(data)):
        if field == _GRAPH:
            graphs.append(_message(value))
        elif field == _METADATA:
            pair = dict(_fields(_message(value)))
            metadata[_text(pair.get(1, b""))] = _text(pair.get(2, b""))
    if len(graphs) != 1:
        raise ValueError("no graph")
    parts = list(_fields(graphs[0]))
    tensors = [list(_fields(_message(part))) for n, part in parts if n == _INITIALIZER]
    weights = {_text(dict(tensor).get(_TENSOR_NAME, b"")): tensor for tensor in tensors}
    inputs, outputs = ([_tensor(_message(part)) for n, part in parts if n == kind] for kind in (_INPUT, _OUTPUT))
    # Until ONNX 1.4 weights were listed as inputs, too.
    pictures = tuple(one for one in inputs if one.name not in weights)
    if not pictures or not outputs:
        raise ValueError("no inputs or no outputs")
    return OnnxHeader(pictures, tuple(outputs), metadata, _subtracted(parts, pictures[0].name, weights))


def _subtracted(parts: _Message, picture: str, weights: Mapping[str, _Message]) -> float | None:
    """The greatest number of the weights that the first node that takes the picture subtracts from it."""
    for node in (list(_fields(_message(part))) for n, part in parts if n == _NODE):
        given = [_text(value) for n, value in node if n == _NODE_INPUT]
        if picture in given:
            tensor = dict(weights.get(given[-1], ())) if _text(dict(node).get(_OPERATOR, b"")) == "Sub" else {}
            is_float = tensor.get(_DATA_TYPE) == 1 and _RAW_DATA in tensor
            return float(np.frombuffer(_message(tensor[_RAW_DATA]), "<f4").max()) if is_float else None
    return None


def _tensor(data: memoryview) -> Tensor:
    """A ValueInfoProto."""
    info = dict(_fields(data))
    kind = dict(_fields(_message(info.get(2, b""))))
    tensor = dict(_fields(_message(kind.get(1, b""))))
    axes = [dict(_fields(_message(axis))) for n, axis in _fields(_message(tensor.get(2, b""))) if n == 1]
    lengths = (axis.get(1) for axis in axes)
    # Some programs write -1 for a free length: as an unsigned number it is beyond 2^63.
    shape = tuple(length if isinstance(length, int) and 0 < length < 1 << 63 else None for length in lengths)
    element = tensor.get(1, 0)
    return Tensor(_text(info.get(1, b"")), shape, element if isinstance(element, int) else 0)


def _fields(data: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Number and value of each field of a message."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind == _VARINT:
            value, at = _varint(data, at)
            yield key >> 3, value
            continue
        if kind == _BYTES:
            length, at = _varint(data, at)
        elif kind in (_FIXED64, _FIXED32):
            length = 8 if kind == _FIXED64 else 4
        else:
            raise ValueError(f"wire type {kind}")
        if at + length > len(data):
            raise ValueError("a field that reaches beyond the end")
        yield key >> 3, data[at : at + length]
        at += length


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, and the place behind it."""
    number = 0
    for place, byte in enumerate(data[at : at + 10]):
        number |= (byte & 0x7F) << 7 * place
        if byte < 0x80:
            return number, at + place + 1
    raise ValueError("a number without an end")


def _message(value: int | memoryview | bytes) -> memoryview:
    if isinstance(value, int):
        raise ValueError("a number in place of a message")
    return memoryview(value)


def _text(value: int | memoryview | bytes) -> str:
    return bytes(_message(value)).decode("utf-8", "replace")
