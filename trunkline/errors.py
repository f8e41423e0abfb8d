"""The exceptions that end a stage in one line: a user's mistake, and nothing to do."""


class InputError(Exception):
    """A user's mistake: bad log, bad parameter, missing file.

    The message is one line that names the file, topic or key, what was found and what was expected.
    Stages print it as ``error: <message>`` and exit with code 1, without a traceback.
    """

    def __str__(self) -> str:
        return " ".join(super().__str__().split())


class Skipped(Exception):
    """A stage that has nothing to do for this arm; the message, one line, says why. It writes nothing."""
