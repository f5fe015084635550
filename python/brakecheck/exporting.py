"""Files of a policy for other programs: weights, observation, ONNX."""

from __future__ import annotations

import json
import os
import shutil
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Names of the networks whose greatest output is the action.
NETWORKS = ("q", "actor")

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


def export_policy(policy: str, described: dict[str, Any], directory: str) -> list[str]:
    """Writes the weights of a `.safetensors` file and the description of its inputs."""
    os.makedirs(directory, exist_ok=True)
    weights = os.path.join(directory, "policy.safetensors")
    shutil.copyfile(policy, weights)
    spec = os.path.join(directory, "observation.json")
    with open(spec, "w", encoding="utf-8") as file:
        json.dump(described, file, indent=2, ensure_ascii=False)
        file.write("\n")
    layers = _layers(_tensors(weights))
    if not layers:
        return [weights, spec]
    network = os.path.join(directory, "policy.onnx")
    with open(network, "wb") as file:
        file.write(_model(layers))
    return [weights, spec, network]


def _tensors(path: str) -> dict[str, NDArray[Any]]:
    """Returns the tensors of a safetensors file: a header in JSON, then their bytes."""
    with open(path, "rb") as file:
        content = file.read()
    (length,) = struct.unpack("<Q", content[:8])
    header = json.loads(content[8 : 8 + length])
    header.pop("__metadata__", None)
    found = {}
    for name, tensor in header.items():
        if tensor["dtype"] == "F32":
            begin, end = (8 + length + at for at in tensor["data_offsets"])
            values = np.frombuffer(content[begin:end], "<f4")
            found[name] = values.reshape(tensor["shape"])
    return found


def _layers(tensors: dict[str, NDArray[Any]]) -> list[Layer]:
    """Returns weights `[in, out]` and biases `[out]` of each layer, or none for a table."""
    for network in NETWORKS:
        layers: list[Layer] = []
        while f"{network}/{len(layers)}/weight" in tensors:
            prefix = f"{network}/{len(layers)}"
            layers.append((tensors[f"{prefix}/weight"], tensors[f"{prefix}/bias"]))
        if layers:
            return layers
    return []


# An ONNX file is one message of protocol buffers. The few that a perceptron needs
# are written here, field numbers as in onnx.proto, so that exporting needs nothing
# else to be installed.


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def _field(number: int, value: int | str | bytes) -> bytes:
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    data = value.encode() if isinstance(value, str) else value
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _tensor(name: str, values: NDArray[np.float32]) -> bytes:
    dims = b"".join(_field(1, size) for size in values.shape)
    raw = np.ascontiguousarray(values, "<f4").tobytes()
    return dims + _field(2, 1) + _field(8, name) + _field(9, raw)


def _node(kind: str, inputs: list[str], output: str, **integers: int) -> bytes:
    message = b"".join(_field(1, name) for name in inputs)
    message += _field(2, output) + _field(3, output) + _field(4, kind)
    for name, value in integers.items():
        message += _field(5, _field(1, name) + _field(3, value) + _field(20, 2))
    return message


def _value(name: str, element: int, *sizes: int) -> bytes:
    dims = [_field(1, _field(2, "batch")), *(_field(1, _field(1, size)) for size in sizes)]
    tensor = _field(1, element) + _field(2, b"".join(dims))
    return _field(1, name) + _field(2, _field(1, tensor))


def _model(layers: list[Layer]) -> bytes:
    """Returns a model of `observation` [batch, in] to `values` and `action` [batch]."""
    graph, last = b"", "observation"
    for i, (weight, bias) in enumerate(layers):
        is_last = i + 1 == len(layers)
        out = "values" if is_last else f"linear_{i}"
        graph += _field(1, _node("Gemm", [last, f"weight_{i}", f"bias_{i}"], out))
        if not is_last:
            graph += _field(1, _node("Relu", [out], f"layer_{i}"))
            out = f"layer_{i}"
        graph += _field(5, _tensor(f"weight_{i}", weight)) + _field(5, _tensor(f"bias_{i}", bias))
        last = out
    graph += _field(1, _node("ArgMax", ["values"], "action", axis=1, keepdims=0))
    graph += _field(2, "ado")
    graph += _field(11, _value("observation", 1, layers[0][0].shape[0]))
    graph += _field(12, _value("values", 1, layers[-1][0].shape[1]))
    graph += _field(12, _value("action", 7))
    opset = _field(1, "") + _field(2, 17)
    return _field(1, 8) + _field(2, "brakecheck") + _field(7, graph) + _field(8, opset)
