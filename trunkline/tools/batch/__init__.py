"""The pipeline for many arms or sessions, and one table and picture over all of them: `trunkline batch`."""
