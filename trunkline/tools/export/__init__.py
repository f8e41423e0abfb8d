"""Sessions beside their simulation, as files that other viewers open: `trunkline export`."""
