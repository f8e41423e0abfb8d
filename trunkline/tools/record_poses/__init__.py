"""Poses at rest for a lab to record, from which a residual map is learnt: `trunkline record-poses`."""
