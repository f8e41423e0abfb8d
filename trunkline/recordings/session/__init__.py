"""A session: what session.yaml says, and the logs that it names."""
