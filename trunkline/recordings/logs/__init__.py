"""Logs: bytes in, streams of samples out. Knows message schemas, and nothing of sessions, arms or experiments."""
