"""Benchmarks: what takes how long, and beside what. Each is a command that keeps what it prints."""
