"""What the inverse kinematics network's file says about itself."""

import json

import onnx
from google.protobuf.message import DecodeError
from onnx.external_data_helper import uses_external_data

from trunkline.errors import InputError
from trunkline.unity.manifest import NetworkBlock, SureBlock, require_widths
from trunkline.unity.rules import Violation, lint_network


def describe_network(data: bytes, file: str, tendons: list[str], source: str) -> tuple[NetworkBlock, list[Violation]]:
    """The manifest's block on the network, and what Unity could not read of it.

    Args:
        data: contents of the ONNX file. file: its path in the package.
        tendons: the model's, in the order of its actuators. source: where it is from, for messages.

    Raises:
        InputError: no ONNX file, or one that does not say what its inputs and outputs are, or other tendons.
    """
    try:
        model = onnx.load_model_from_string(data)
    except DecodeError as error:
        raise InputError(f"{source}: found {error}, expected an ONNX file") from error
    inputs, outputs = _names(model, "inputs", source), _names(model, "outputs", source)
    if outputs != tendons:
        raise InputError(f"{source}: found outputs {outputs}, expected those of the model's actuators, {tendons}")
    require_widths(_widths(model.graph.input), _widths(model.graph.output), inputs, outputs, source)
    opset = max(entry.version for entry in model.opset_import)
    block = NetworkBlock(
        file=file,
        opset=opset,
        input_order=inputs,
        input=model.graph.input[0].name,
        outputs={value.name: _text(model, value.name, source) for value in model.graph.output},
        output_order=outputs,
        doubt_beyond=float(_text(model, "doubt_beyond_m", source)),
        sure=_sure(model),
        operators=sorted({node.op_type for node in model.graph.node}),
    )
    external = any(uses_external_data(tensor) for tensor in model.graph.initializer)
    return block, lint_network(opset, external)


def _sure(model: onnx.ModelProto) -> SureBlock | None:
    meaning = {entry.key: entry.value for entry in model.metadata_props}
    if "sure_pulls_m" not in meaning:
        return None
    tilt, pulled_tilt = json.loads(meaning["sure_tilts_deg"])
    return SureBlock(pulls=float(meaning["sure_pulls_m"]), tilt=tilt, pulled_tilt=pulled_tilt)


def _names(model: onnx.ModelProto, key: str, source: str) -> list[str]:
    """What the network's training wrote on the columns of its inputs or outputs."""
    return json.loads(_text(model, key, source))


def _text(model: onnx.ModelProto, key: str, source: str) -> str:
    texts = [entry.value for entry in model.metadata_props if entry.key == key]
    if not texts:
        raise InputError(f"{source}: found no {key!r} in the file's metadata, expected a network of train_ik")
    return texts[0]


def _widths(values) -> list[int]:
    """The last dimension of each of a graph's inputs or outputs."""
    return [value.type.tensor_type.shape.dim[-1].dim_value for value in values]
