"""What a session can identify, before hours of fits: `trunkline check`."""
