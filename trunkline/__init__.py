"""Trunkline: motion-capture logs in, a calibrated digital twin of a tendon-driven soft arm out."""
