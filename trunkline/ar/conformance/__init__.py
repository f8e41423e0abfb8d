"""Shared vectors: what the core of teleoperation answers, for clients in other languages."""
