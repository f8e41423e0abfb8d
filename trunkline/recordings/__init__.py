"""Recordings: from the bytes of a log to trials on one clock, in the base frame."""
