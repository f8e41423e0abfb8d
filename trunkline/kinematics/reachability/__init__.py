"""Reachability maps: of the rigid arm, of the soft arm per gravity angle, of both together."""
