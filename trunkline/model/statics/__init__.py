"""Statics of a compiled model: its chain, and the equilibria that it rests in."""
