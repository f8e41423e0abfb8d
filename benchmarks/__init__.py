"""Benchmarks: what takes how long, and beside what. Each is a command that keeps what it prints."""

from trunkline.compute.numerics import hold_arithmetic

hold_arithmetic()
