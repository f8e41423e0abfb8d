"""The stand-in lab."""
