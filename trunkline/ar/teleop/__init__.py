"""Teleoperation without a headset: tracked poses and buttons in, intents out; plans, and what executes them."""
