"""The edge: settings, files, the lock, the gate, the README."""
