"""What to record next, by its expected information: `trunkline suggest`."""
