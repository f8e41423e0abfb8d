"""Upkeep of this repository: README, gate, baseline, lock, versions, kept results. No part of the library."""
