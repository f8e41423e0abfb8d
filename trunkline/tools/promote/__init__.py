"""A new twin in the place of an old one, where it replays both sessions: `trunkline promote`."""
