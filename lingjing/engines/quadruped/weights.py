"""The layers of a multilayer perceptron out of an ONNX file, read with numpy alone.

An ONNX file is one protobuf message. Of it only the initialisers (named float tensors) and the matrix products of the
graph are needed: fields 7 of `ModelProto` (graph), 1 and 5 of `GraphProto` (nodes, initialisers), as numbered in
https://github.com/onnx/onnx/blob/main/onnx/onnx.proto.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lingjing.errors import InfrastructureError

Matrix = npt.NDArray[np.float32]

_FLOAT = 1
_GRAPH, _NODE, _INITIALISER = 7, 1, 5
_NODE_INPUT, _NODE_KIND = 1, 4
_DIMENSIONS, _TYPE, _NAME, _RAW = 1, 2, 8, 9


def read_layers(path: Path) -> tuple[tuple[Matrix, Matrix], ...]:
    """Weights (inputs, outputs) and biases (outputs,) of each layer, first to last."""
    try:
        graph = next(value for number, value in _fields(path.read_bytes()) if number == _GRAPH)
        parts = list(_fields(_block(graph)))
        tensors = dict(_tensor(_block(value)) for number, value in parts if number == _INITIALISER)
        nodes = [list(_fields(_block(value))) for number, value in parts if number == _NODE]
        products = [node for node in nodes if (_NODE_KIND, b"Gemm") in node]
        named = [[_block(value).decode() for number, value in node if number == _NODE_INPUT] for node in products]
        return tuple((np.ascontiguousarray(tensors[weight].T), tensors[bias]) for _, weight, bias in named)
    except (StopIteration, IndexError, KeyError, ValueError, TypeError, OSError) as fault:
        raise InfrastructureError(f"{path} is not a walking policy that can be read: {fault!r}") from fault


def _tensor(block: bytes) -> tuple[str, Matrix]:
    name, shape, raw = "", list[int](), b""
    for number, value in _fields(block):
        if number == _DIMENSIONS:
            shape += [value] if isinstance(value, int) else _packed(value)
        elif number == _TYPE and value != _FLOAT:
            raise ValueError("a tensor that is not of 32-bit floats")
        elif number == _NAME:
            name = _block(value).decode()
        elif number == _RAW:
            raw = _block(value)
    return name, np.frombuffer(raw, "<f4").astype(np.float32).reshape(shape)


def _fields(block: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Numbers and values of a message's fields: whole numbers, or bytes for everything that has a length."""
    at = 0
    while at < len(block):
        key, at = _varint(block, at)
        kind = key & 7
        if kind == 0:
            value, at = _varint(block, at)
            yield key >> 3, value
            continue
        if kind == 2:
            length, at = _varint(block, at)
        else:
            length = {1: 8, 5: 4}[kind]
        yield key >> 3, block[at : at + length]
        at += length


def _packed(block: bytes) -> list[int]:
    numbers, at = list[int](), 0
    while at < len(block):
        number, at = _varint(block, at)
        numbers.append(number)
    return numbers


def _varint(block: bytes, at: int) -> tuple[int, int]:
    number = shift = 0
    while True:
        byte = block[at]
        at += 1
        number |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return number, at


def _block(value: int | bytes) -> bytes:
    if isinstance(value, int):
        raise TypeError("a number where a message was expected")
    return value
