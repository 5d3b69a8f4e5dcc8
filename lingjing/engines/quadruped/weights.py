"""The layers of a multilayer perceptron from an ONNX file: its float tensors and its matrix products.

An ONNX file is one protobuf message. This module declares the part of it that is read, with the field numbers of
https://github.com/onnx/onnx/blob/main/onnx/onnx.proto.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import DecodeError
from google.protobuf.message_factory import GetMessageClass

from lingjing.errors import InfrastructureError

Matrix = npt.NDArray[np.float32]

_FLOAT = 1
"""`TensorProto.DataType.FLOAT`."""

_MESSAGES: dict[str, dict[str, tuple[int, str]]] = {
    "Model": {"graph": (7, "Graph")},
    "Graph": {"node": (1, "Node"), "initializer": (5, "Tensor")},
    "Node": {"input": (1, "string"), "op_type": (4, "string")},
    "Tensor": {"dims": (1, "int64"), "data_type": (2, "int32"), "name": (8, "string"), "raw_data": (9, "bytes")},
}
"""Fields of each message that are read: number and type."""

_REPEATED = frozenset({"node", "initializer", "input", "dims"})


def read_layers(path: Path) -> tuple[tuple[Matrix, Matrix], ...]:
    """Return weights (inputs, outputs) and biases (outputs,) of each layer, first to last.

    Raises `InfrastructureError` if the file is no such network.
    """
    try:
        graph = _model().FromString(path.read_bytes()).graph
        tensors = {tensor.name: _tensor(tensor) for tensor in graph.initializer}
        named = [node.input for node in graph.node if node.op_type == "Gemm"]
        layers = tuple((np.ascontiguousarray(tensors[weight].T), tensors[bias]) for _, weight, bias in named)
    except (KeyError, ValueError, OSError, DecodeError) as fault:
        raise InfrastructureError(f"{path} is not a walking policy that can be read: {fault!r}") from fault
    if not layers:
        raise InfrastructureError(f"{path} is not a walking policy that can be read: it has no layers")
    return layers


def _tensor(message: Any) -> Matrix:
    if message.data_type != _FLOAT:
        raise ValueError("a tensor does not hold 32-bit floats")
    return np.frombuffer(message.raw_data, "<f4").astype(np.float32).reshape(message.dims)


def _model() -> Any:
    """Return the class of the message of a whole file."""
    file = FileDescriptorProto(name="onnx.proto", package="onnx", syntax="proto2")
    for name, fields in _MESSAGES.items():
        message = file.message_type.add(name=name)
        for field, (number, kind) in fields.items():
            made = message.field.add(name=field, number=number)
            made.label = made.LABEL_REPEATED if field in _REPEATED else made.LABEL_OPTIONAL
            if kind in _MESSAGES:
                made.type, made.type_name = made.TYPE_MESSAGE, f".onnx.{kind}"
            else:
                made.type = FieldDescriptorProto.Type.Value(f"TYPE_{kind.upper()}")
    pool = DescriptorPool()
    pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName("onnx.Model"))
