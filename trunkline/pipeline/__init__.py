"""The pipeline seen as a whole: its settings, its lock file, its regression gate and its README."""
