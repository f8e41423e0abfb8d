"""The stages that identify, by their names everywhere."""

STAGES = ("identify_stiffness", "identify_damping", "identify_control")  # in their order: each goes on from the last
