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
from trunkline.kinematics.residual.residual_map import ResidualMap

OPSET = 15
CORRECTIONS = 3  # by the residual map: each leaves a tenth or less, as that changes so much less than the tip
IR_VERSION = 8  # of the ONNX release that brought opset 15
GRAVITY = {
    len(POSE): "none: nothing pulls but the tendons",
    len(TILT): "theta_g, rad: angle between the straight arm and gravity, the mount tilting about base +y",
    len(DIRECTION): "gx, gy, gz: direction of gravity in the base frame, of unit length",
}


@dataclass(frozen=True)
class TrialsAtRest:
    """What trials at rest say of the arm beside its twin.

    straight_lengths: of each tendon, the arm straight, m. Shape (K,). sure_pulls: sum of what all motors draw in, m, up
    to which the certificate has the tip near its twin's. tilt_deg, pulled_tilt_deg: of the mount, at most, without a
    pull and with one. residual_map: by how far the tip rests beside the twin's, None where too few poses tell.
    """

    straight_lengths: np.ndarray
    sure_pulls: float
    tilt_deg: float
    pulled_tilt_deg: float
    residual_map: ResidualMap | None = None


class _Graph:
    """Nodes and constants of a network, as they are added. Each returns the name of what it adds."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: dict[str, onnx.TensorProto] = {}

    def constant(self, name: str, values) -> str:
        """Once, however often it is asked for."""
        self.constants.setdefault(name, numpy_helper.from_array(np.asarray(values), name))
        return name

    def number(self, name: str, values) -> str:
        return self.constant(name, np.asarray(values, np.float32))

    def node(self, kind: str, inputs: list[str], output: str, **attributes) -> str:
        self.nodes.append(helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output

    def gather(self, source: str, columns: list[int] | np.ndarray, name: str, step: str = "") -> str:
        """Columns, counted from 0: not every engine counts from the end."""
        return self.node("Gather", [source, self.constant(f"{name}_columns", np.array(columns, np.int64))],
                         name + step, axis=1)  # fmt: skip

    def clip(self, x: str, lowest: float, name: str, step: str) -> str:
        """From `lowest` to 1."""
        bounds = [self.number(f"{name}_lowest", lowest), self.number(f"{name}_highest", 1)]
        return self.node("Clip", [x, *bounds], name + step)

    def perceptron(self, x: str, layers: nn.Sequential, name: str, step: str) -> str:
        linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
        for index, layer in enumerate(linear, start=1):
            weight = self.constant(f"{name}_weight_{index}", layer.weight.detach().numpy().T.copy())
            bias = self.constant(f"{name}_bias_{index}", layer.bias.detach().numpy())
            x = self.node("Gemm", [x, weight, bias], f"{name}_layer_{index}{step}")
            if index < len(linear):
                x = self.node("Relu", [x], f"{name}_relu_{index}{step}")
        return x


def to_onnx(
    network: InverseKinematics, tendons: list[str], doubt_beyond: float, at_rest: TrialsAtRest | None = None
) -> onnx.ModelProto:
    """A model from `pose` (N, 7, 8 or 10) to `commands` (N, K), `lengths` (N, K) and `tip` (N, 3), float32.

    With a residual map r, commands c are those that bring the twin's tip to the target less r(c), in `CORRECTIONS`
    steps from those for the target itself, and "tip" is the twin's tip moved by r(c).

    Args:
        tendons: names, in the order of the columns of commands and lengths.
        doubt_beyond: m; a foreseen tip further than this from its target is a reason to doubt. Only written down.
        at_rest: None where no certificate says it. Only written down, but for the residual map.
    """
    graph, inputs = _Graph(), _inputs(network)
    first = len(inputs) - len(POSE)
    position = graph.gather("pose", [first, first + 1, first + 2], "position")
    quaternion = [graph.gather("pose", np.array(part) % len(inputs), name)
                  for part, name in ((FIRST, "first"), (SECOND, "second"))]  # fmt: skip
    products = graph.node("Mul", quaternion, "quaternion_products")
    pulling = []
    if inputs == TILT:
        angle = graph.gather("pose", [0], "theta_g")
        pulling = [graph.node("Sin", [angle], "sin_theta_g"), graph.node("Cos", [angle], "cos_theta_g")]
    elif inputs == DIRECTION:
        pulling = [graph.gather("pose", [0, 1, 2], "gravity")]

    aimed, learnt = position, at_rest and at_rest.residual_map
    if at_rest and learnt:
        for number in range(CORRECTIONS):
            step = f"_{number + 1}"
            _, commands = _inverse(graph, network, [*pulling, aimed, products], len(tendons), step)
            shift = _shift(graph, learnt, at_rest.straight_lengths, pulling, commands, step)
            aimed = graph.node("Sub", [position, shift], f"aimed{step}")
    pulls, commands = _inverse(graph, network, [*pulling, aimed, products], len(tendons), "")
    x = graph.perceptron(graph.node("Concat", [*pulling, pulls], "seen", axis=1), network.tip_layers, "tip", "")
    x = graph.node("Mul", [x, graph.constant("tip_half_range", network.tip_half_range.numpy())], "tip_offset")
    twin = "twin_tip" if at_rest and learnt else "tip"
    graph.node("Add", [x, graph.constant("tip_middle", network.tip_middle.numpy())], twin)
    if at_rest and learnt:
        shift = _shift(graph, learnt, at_rest.straight_lengths, pulling, commands, "")
        graph.node("Add", [twin, shift], "tip")

    pose = helper.make_tensor_value_info("pose", TensorProto.FLOAT, ["batch", len(inputs)])
    widths = dict(zip(OUTPUTS, (len(tendons), len(tendons), 3), strict=True))
    outputs = [helper.make_tensor_value_info(k, TensorProto.FLOAT, ["batch", n]) for k, n in widths.items()]
    whole = helper.make_graph(graph.nodes, "inverse_kinematics", [pose], outputs, list(graph.constants.values()))
    model = helper.make_model(whole, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    model.producer_name = "trunkline"
    helper.set_model_props(model, _meaning(network, tendons, doubt_beyond) | _of_trials(at_rest))
    onnx.checker.check_model(model, full_check=True)
    return model


def _inverse(
    graph: _Graph, network: InverseKinematics, parts: list[str], tendons: int, step: str
) -> tuple[str, str]:
    """Commands for the pose whose features begin with `parts`: as shares of their range, and in m. Of the last `step`,
    "", "lengths" too."""
    features, last = list(parts), not step
    if network.inputs == len(DIRECTION):
        pose, size = graph.node("Concat", parts[-2:], f"pose_features{step}", axis=1), 3 + len(FIRST)
        tiled = graph.gather(pose, np.tile(np.arange(size), 3), "mixed_pose", step)
        mixed = graph.gather("pose", np.repeat([0, 1, 2], size), "mixed_gravity", step)
        features.append(graph.node("Mul", [mixed, tiled], f"mixed{step}"))
    x = graph.node("Concat", features, f"features{step}", axis=1)
    x = graph.node("Sub", [x, graph.constant("mean", network.mean.numpy())], f"centred{step}")
    x = graph.node("Mul", [x, graph.constant("scale", network.scale.numpy())], f"normalised{step}")
    both = graph.perceptron(x, network.layers, "inverse", step)
    pulls = graph.clip(graph.gather(both, np.arange(tendons), "raw_pulls", step), -1, "pulls", step)
    x = graph.node("Mul", [pulls, graph.constant("half_range", network.half_range.numpy())], f"offset{step}")
    commands = graph.node("Add", [x, graph.constant("middle", network.middle.numpy())], f"commands{step}")
    if last:
        raw = graph.gather(both, np.arange(tendons, 2 * tendons), "raw_stretches")
        shares = graph.clip(raw, 0, "stretch_shares", step)
        most = graph.constant("most_stretch", network.most_stretch.numpy())
        graph.node("Add", [commands, graph.node("Mul", [shares, most], "stretches")], "lengths")
    return pulls, commands


def _shift(
    graph: _Graph, learnt: ResidualMap, straight: np.ndarray, pulling: list[str], commands: str, step: str
) -> str:
    """By how far the tip rests beside the twin's under `commands`, m."""
    _, _, pull_length, gravity_length, least = learnt.numbers
    recorded, tendons = learnt.features(learnt.poses), len(straight)
    pulls = graph.node("Sub", [graph.number("straight", straight), commands], f"drawn_in{step}")
    shares = graph.node("Mul", [graph.node("Relu", [pulls], f"pulled{step}"),
                                graph.number("by_largest", 1 / learnt.largest)], f"pull_shares{step}")  # fmt: skip
    # what gravity adds to the exponents, and to the square of what is asked; nothing of an arm without it
    turn = np.array([[1, 0, 0], [0, 0, -1]]) if len(pulling) == 2 else np.eye(3)[: 3 * len(pulling)]
    asked = graph.node("Concat", [*pulling, shares], f"asked{step}", axis=1)
    scaled = np.zeros((len(turn) + tendons, tendons + 3))
    scaled[: len(turn), tendons:], scaled[len(turn) :, :tendons] = turn / gravity_length, np.eye(tendons) / pull_length
    nothing = np.zeros(tendons + 3)
    x = graph.node("Gemm", [asked, graph.number("to_features", scaled), graph.number("no_features", nothing)],
                   f"rest_features{step}")  # fmt: skip
    recorded_squares = -(recorded**2).sum(axis=1) / 2
    across = graph.node("Gemm", [x, graph.number("recorded", recorded.T), graph.number("squares", recorded_squares)],
                        f"across{step}")  # fmt: skip
    halves = graph.number("halves", np.full((tendons + 3, 1), -0.5))
    squared = graph.node("Gemm", [graph.node("Mul", [x, x], f"squared{step}"), halves, graph.number("zero", [0.0])],
                         f"asked_squares{step}")  # fmt: skip
    alike = graph.node("Exp", [graph.node("Add", [across, squared], f"exponents{step}")], f"alike{step}")
    heights = [alike, graph.number("heights", learnt.heights), graph.number("no_shift", np.zeros(3))]
    flat = graph.node("Gemm", heights, f"unweighted{step}")
    ones = [graph.node("Mul", [shares, shares], f"share_squares{step}"), graph.number("ones", np.ones((tendons, 1)))]
    weight = graph.node("Gemm", [*ones, graph.number("least_weight", [least**2])], f"squared_weight{step}")
    return graph.node("Mul", [flat, graph.node("Sqrt", [weight], f"weight{step}")], f"shift{step}")


def _inputs(network: InverseKinematics) -> list[str]:
    return next(inputs for inputs in (POSE, TILT, DIRECTION) if len(inputs) == network.inputs)


def _of_trials(at_rest: TrialsAtRest | None) -> dict[str, str]:
    """Metadata."""
    if at_rest is None:
        return {}
    straight = json.dumps([round(float(length), 9) for length in at_rest.straight_lengths])
    learnt = at_rest.residual_map
    moved = {} if learnt is None else {"residual_map": f"of {len(learnt.poses)} poses of the arm at rest: commands are "
                                       "for it, no longer for its twin alone"}  # fmt: skip
    return moved | {"straight_lengths_m": straight, "sure_pulls_m": f"{at_rest.sure_pulls:.6g}",
            "sure_tilts_deg": json.dumps([round(at_rest.tilt_deg, 6), round(at_rest.pulled_tilt_deg, 6)])}  # fmt: skip


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
