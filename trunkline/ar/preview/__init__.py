"""What a client has: the package whole, the twin as it is believed, and what may come of a plan."""
