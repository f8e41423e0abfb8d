"""Commands for logs that are not a session yet: look at them, propose a session.yaml, convert Motive's exports."""
