"""The one exception for mistakes that a user can make and mend."""


class InputError(Exception):
    """A user's mistake: bad log, bad parameter, missing file.

    The message is one line that names the file, topic or key, what was found and what was expected.
    Stages print it as ``error: <message>`` and exit with code 1, without a traceback.
    """

    def __str__(self) -> str:
        return " ".join(super().__str__().split())
