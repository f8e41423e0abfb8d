"""The version of the library: pyproject.toml reads it here, and so does the Unity package's manifest."""

__version__ = "0.1.0"
