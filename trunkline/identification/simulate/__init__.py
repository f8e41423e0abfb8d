"""Trials as simulations: set up, at rest or in motion, all candidates at once."""
