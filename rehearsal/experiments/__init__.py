"""Seeded runs of the paper's experiments on the stand-in robot: one function an experiment, one result a run."""
