"""What teleoperation asks of a package's files: its network."""

from trunkline.ar.teleop import tendons
from trunkline.errors import InputError
from trunkline.twin.package import data_of, manifest_of
from trunkline.unity.manifest import require_widths


def network_of(files: dict[str, bytes]) -> tendons.Network:
    """The network, to be asked.

    Raises:
        InputError: its file is no network, or one of other inputs or outputs than the manifest says.
    """
    block = manifest_of(files).block("network")
    try:
        session = tendons.session_of(data_of(files, block.text("file")))
    except tendons.NO_NETWORK as error:
        raise InputError(f"network: found {str(error).splitlines()[0]}, expected an ONNX file") from None
    took, gave = ([node.shape[-1] for node in ends] for ends in (session.get_inputs(), session.get_outputs()))
    require_widths(took, gave, block["input_order"], block["output_order"], "network")
    return tendons.network_of(session)
