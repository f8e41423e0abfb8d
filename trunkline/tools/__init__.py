"""Commands of a lab: before a session, between sessions, and about many arms."""
