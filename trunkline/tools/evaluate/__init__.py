"""A model against a session, without a fit: `trunkline evaluate`."""
