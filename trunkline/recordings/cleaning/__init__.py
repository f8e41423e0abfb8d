"""Takes: trials as recorded, checked and repaired, each on its own clocks."""
