"""What the inverse kinematics network's file says about itself."""

import onnx
from google.protobuf.message import DecodeError
from onnx.external_data_helper import uses_external_data

from trunkline.errors import InputError
from trunkline.unity.manifest import Network
from trunkline.unity.rules import Violation, lint_network

INPUTS = ["theta_g", "x", "y", "z", "qw", "qx", "qy", "qz"]


def describe_network(
    data: bytes, file: str, tendons: list[str], source: str
) -> tuple[Network, list[Violation]]:
    """The manifest's block on the network, and what Unity could not read of it.

    Args:
        data: contents of the ONNX file. file: its path in the package.
        tendons: the model's, in the order of its actuators. source: where it is from, for messages.
    """
    try:
        model = onnx.load_model_from_string(data)
    except DecodeError as error:
        raise InputError(f"{source}: found {error}, expected an ONNX file") from error
    widths = [_widths(values) for values in (model.graph.input, model.graph.output)]
    if widths != [[len(INPUTS)], [len(tendons)]]:
        raise InputError(
            f"{source}: found inputs of width {widths[0]} and outputs of width {widths[1]}, expected one"
            f" input ({', '.join(INPUTS)}) and one output ({', '.join(tendons)})"
        )
    opset = max(entry.version for entry in model.opset_import)
    block = Network(
        file=file,
        opset=opset,
        input_order=INPUTS,
        input=model.graph.input[0].name,
        output=model.graph.output[0].name,
        output_order=tendons,
        operators=sorted({node.op_type for node in model.graph.node}),
    )
    external = any(uses_external_data(tensor) for tensor in model.graph.initializer)
    return block, lint_network(opset, external)


def _widths(values) -> list[int]:
    """The last dimension of each of a graph's inputs or outputs."""
    return [value.type.tensor_type.shape.dim[-1].dim_value for value in values]
