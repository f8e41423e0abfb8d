"""Disks on which a log cannot be written; a process of its own opens them, so little is imported here."""

import errno
import io
import os
import time

ROOM = 20_000  # bytes


def full(path):
    return open("/dev/full", "wb")


class Filling(io.FileIO):
    def write(self, data):
        if self.tell() + len(data) > ROOM:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def filling(path):
    """It has ROOM."""
    return Filling(path, "wb")


def stuck(path):
    """It never answers."""
    time.sleep(600.0)
