"""The network as one ONNX file of opset 15, with what its inputs and outputs mean written in it."""

import json

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from trunkline.ik.network import FIRST, INPUTS, SECOND, InverseKinematics

OPSET = 15
IR_VERSION = 8  # of the ONNX release that brought opset 15


def to_onnx(network: InverseKinematics, tendons: list[str]) -> onnx.ModelProto:
    """A model with input `pose` (N, 8) and output `lengths` (N, K), float32, weights inside.

    Args:
        tendons: names, in the order of the outputs.
    """
    nodes, constants = [], []

    def constant(name: str, values) -> str:
        constants.append(numpy_helper.from_array(np.asarray(values), name))
        return name

    def node(kind: str, inputs: list[str], output: str, **attributes) -> str:
        nodes.append(helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output

    def gather(columns: list[int], output: str) -> str:
        return node("Gather", ["pose", constant(f"{output}_columns", np.array(columns, np.int64))], output, axis=1)

    angle, position = gather([0], "theta_g"), gather([1, 2, 3], "position")
    products = node("Mul", [gather(FIRST, "first"), gather(SECOND, "second")], "quaternion_products")
    parts = [node("Sin", [angle], "sin_theta_g"), node("Cos", [angle], "cos_theta_g"), position, products]
    x = node("Concat", parts, "features", axis=1)
    x = node("Sub", [x, constant("mean", network.mean.numpy())], "centred")
    x = node("Mul", [x, constant("scale", network.scale.numpy())], "normalised")
    linear = [layer for layer in network.layers if isinstance(layer, nn.Linear)]
    for index, layer in enumerate(linear, start=1):
        weight = constant(f"weight_{index}", layer.weight.detach().numpy().T.copy())
        bias = constant(f"bias_{index}", layer.bias.detach().numpy())
        x = node("Gemm", [x, weight, bias], f"layer_{index}")
        if index < len(linear):
            x = node("Relu", [x], f"relu_{index}")
    bounds = [constant("lowest", np.float32(-1)), constant("highest", np.float32(1))]
    x = node("Clip", [x, *bounds], "in_range")
    x = node("Mul", [x, constant("half_range", network.half_range.numpy())], "offset")
    node("Add", [x, constant("middle", network.middle.numpy())], "lengths")

    pose = helper.make_tensor_value_info("pose", TensorProto.FLOAT, ["batch", len(INPUTS)])
    lengths = helper.make_tensor_value_info("lengths", TensorProto.FLOAT, ["batch", len(tendons)])
    graph = helper.make_graph(nodes, "inverse_kinematics", [pose], [lengths], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    model.producer_name = "trunkline"
    helper.set_model_props(model, _meaning(network, tendons))
    onnx.checker.check_model(model, full_check=True)
    return model


def _meaning(network: InverseKinematics, tendons: list[str]) -> dict[str, str]:
    """Metadata: names, shapes, units, frame, normalisation."""
    low, high = network.middle - network.half_range, network.middle + network.half_range
    return {
        "inputs": json.dumps(INPUTS),
        "input_units": json.dumps(["rad", "m", "m", "m", "1", "1", "1", "1"]),
        "input_shape": json.dumps(["batch", len(INPUTS)]),
        "outputs": json.dumps(tendons),
        "output_units": json.dumps(["m"] * len(tendons)),
        "output_shape": json.dumps(["batch", len(tendons)]),
        "output_range_m": json.dumps([[round(float(v), 9) for v in pair] for pair in zip(low, high, strict=True)]),
        "output_meaning": "tendon path lengths to command; a slack tendon may be given more than its path",
        "frame": "tip pose in the base frame: origin at the mount, straight arm along -z, tendon 1 over +x",
        "quaternion": "w, x, y, z, unit length, either sign",
        "normalisation": "inside the network",
    }
