"""A model against a session, without a fit: `python -m trunkline.evaluate`."""
