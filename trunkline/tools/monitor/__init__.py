"""Whether an arm has changed since its model was identified: `trunkline monitor`."""
