"""The network as one ONNX file of opset 15, with what its inputs and outputs mean written in it."""

import json
from dataclasses import dataclass

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from trunkline.kinematics.dataset.columns import POSE
from trunkline.kinematics.ik.inputs import DIRECTION, TILT, UNITS
from trunkline.kinematics.ik.network import FIRST, OUTPUTS, SECOND, InverseKinematics

OPSET = 15
IR_VERSION = 8  # of the ONNX release that brought opset 15
GRAVITY = {
    len(POSE): "none: nothing pulls but the tendons",
    len(TILT): "theta_g, rad: angle between the straight arm and gravity, the mount tilting about base +y",
    len(DIRECTION): "gx, gy, gz: direction of gravity in the base frame, of unit length",
}


@dataclass(frozen=True)
class SurePulls:
    """Up to which the certificate has the arm's tip near its twin's.

    straight_lengths: of each tendon, the arm straight, m. Shape (K,). most: sum of what all motors draw in, m.
    tilt_deg, pulled_tilt_deg: of the mount, at most, without a pull and with one.
    """

    straight_lengths: np.ndarray
    most: float
    tilt_deg: float
    pulled_tilt_deg: float


def to_onnx(
    network: InverseKinematics, tendons: list[str], doubt_beyond: float, sure: SurePulls | None = None
) -> onnx.ModelProto:
    """A model from `pose` (N, 7, 8 or 10) to `commands` (N, K), `lengths` (N, K) and `tip` (N, 3), float32.

    Args:
        tendons: names, in the order of the columns of commands and lengths.
        doubt_beyond: m; a foreseen tip further than this from its target is a reason to doubt. Only written down.
        sure: also only written down; None where no certificate says it.
    """
    nodes, constants = [], []

    def constant(name: str, values) -> str:
        constants.append(numpy_helper.from_array(np.asarray(values), name))
        return name

    def node(kind: str, inputs: list[str], output: str, **attributes) -> str:
        nodes.append(helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output

    def gather(columns: list[int] | np.ndarray, output: str) -> str:
        places = np.array(columns, np.int64) % len(inputs)  # not from the end: not every engine counts so
        return node("Gather", ["pose", constant(f"{output}_columns", places)], output, axis=1)

    inputs = _inputs(network)
    position = gather([-7, -6, -5], "position")
    products = node("Mul", [gather(FIRST, "first"), gather(SECOND, "second")], "quaternion_products")
    pulling = []
    if inputs == TILT:
        angle = gather([0], "theta_g")
        pulling = [node("Sin", [angle], "sin_theta_g"), node("Cos", [angle], "cos_theta_g")]
    elif inputs == DIRECTION:
        pulling = [gather([0, 1, 2], "gravity")]
    features = [*pulling, position, products]
    if inputs == DIRECTION:
        pose, size = node("Concat", [position, products], "pose_features", axis=1), 3 + len(FIRST)
        columns = constant("mixed_columns", np.tile(np.arange(size), 3))
        tiled = node("Gather", [pose, columns], "mixed_pose", axis=1)
        features.append(node("Mul", [gather(np.repeat([0, 1, 2], size), "mixed_gravity"), tiled], "mixed"))
    x = node("Concat", features, "features", axis=1)
    x = node("Sub", [x, constant("mean", network.mean.numpy())], "centred")
    x = node("Mul", [x, constant("scale", network.scale.numpy())], "normalised")

    def perceptron(x: str, layers: nn.Sequential, name: str) -> str:
        linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
        for index, layer in enumerate(linear, start=1):
            weight = constant(f"{name}_weight_{index}", layer.weight.detach().numpy().T.copy())
            bias = constant(f"{name}_bias_{index}", layer.bias.detach().numpy())
            x = node("Gemm", [x, weight, bias], f"{name}_layer_{index}")
            if index < len(linear):
                x = node("Relu", [x], f"{name}_relu_{index}")
        return x

    def columns_of(x: str, first: int, output: str) -> str:
        columns = constant(f"{output}_columns", np.arange(first, first + len(tendons), dtype=np.int64))
        return node("Gather", [x, columns], output, axis=1)

    def clip(x: str, lowest: float, output: str) -> str:
        bounds = [constant(f"{output}_lowest", np.float32(lowest)), constant(f"{output}_highest", np.float32(1))]
        return node("Clip", [x, *bounds], output)

    both = perceptron(x, network.layers, "inverse")
    pulls = clip(columns_of(both, 0, "raw_pulls"), -1, "pulls")
    x = node("Mul", [pulls, constant("half_range", network.half_range.numpy())], "offset")
    commands = node("Add", [x, constant("middle", network.middle.numpy())], "commands")
    stretches = clip(columns_of(both, len(tendons), "raw_stretches"), 0, "stretch_shares")
    x = node("Mul", [stretches, constant("most_stretch", network.most_stretch.numpy())], "stretches")
    node("Add", [commands, x], "lengths")
    x = perceptron(node("Concat", [*pulling, pulls], "seen", axis=1), network.tip_layers, "tip")
    x = node("Mul", [x, constant("tip_half_range", network.tip_half_range.numpy())], "tip_offset")
    node("Add", [x, constant("tip_middle", network.tip_middle.numpy())], "tip")

    pose = helper.make_tensor_value_info("pose", TensorProto.FLOAT, ["batch", len(inputs)])
    widths = dict(zip(OUTPUTS, (len(tendons), len(tendons), 3), strict=True))
    outputs = [helper.make_tensor_value_info(k, TensorProto.FLOAT, ["batch", n]) for k, n in widths.items()]
    graph = helper.make_graph(nodes, "inverse_kinematics", [pose], outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    model.producer_name = "trunkline"
    helper.set_model_props(model, _meaning(network, tendons, doubt_beyond) | _surety(sure))
    onnx.checker.check_model(model, full_check=True)
    return model


def _inputs(network: InverseKinematics) -> list[str]:
    return next(inputs for inputs in (POSE, TILT, DIRECTION) if len(inputs) == network.inputs)


def _surety(sure: SurePulls | None) -> dict[str, str]:
    """Metadata."""
    if sure is None:
        return {}
    straight = json.dumps([round(float(length), 9) for length in sure.straight_lengths])
    return {"straight_lengths_m": straight, "sure_pulls_m": f"{sure.most:.6g}",
            "sure_tilts_deg": json.dumps([round(sure.tilt_deg, 6), round(sure.pulled_tilt_deg, 6)])}  # fmt: skip


def _meaning(network: InverseKinematics, tendons: list[str], doubt_beyond: float) -> dict[str, str]:
    """Metadata: names, shapes, units, frame, normalisation."""
    inputs = _inputs(network)
    low, high = network.middle - network.half_range, network.middle + network.half_range
    return {
        "inputs": json.dumps(inputs),
        "input_units": json.dumps([UNITS.get(name, "1") for name in inputs]),
        "input_shape": json.dumps(["batch", len(inputs)]),
        "gravity": GRAVITY[len(inputs)],
        "outputs": json.dumps(tendons),
        "output_units": json.dumps(["m"] * len(tendons)),
        "output_shape": json.dumps(["batch", len(tendons)]),
        "commands_range_m": json.dumps([[round(float(v), 9) for v in pair] for pair in zip(low, high, strict=True)]),
        "commands": "what each tendon's position actuator is sent; a slack tendon may be given more than its path",
        "lengths": "path length of each tendon at rest: longer than the command by tension / kp. Not to be sent",
        "tip": "x, y, z in the base frame, m: where the tip will come to rest. Off the target: out of the arm's reach",
        "doubt_beyond_m": f"{doubt_beyond:.6g}",
        "frame": "tip pose in the base frame: origin at the mount, straight arm along -z, tendon 1 over +x",
        "quaternion": "w, x, y, z, unit length, either sign",
        "normalisation": "inside the network",
    }
