"""Identification side by side with raw simulation, with the paper's recipe as first written, and with mujoco.sysid."""
