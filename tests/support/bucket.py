"""A bucket on this machine: a server that speaks S3, and what DVC has to be told of it."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from socket import socket
from urllib.request import Request, urlopen

from tests.support.waiting import until

NAME, KEY, SECRET = "trunkline", "a-key", "a-secret"


@contextmanager
def bucket() -> Iterator[dict[str, str]]:
    """An empty one, while this lasts: its `url`, and what `dvc remote modify` takes."""
    with socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        there = {"endpointurl": f"http://127.0.0.1:{port}", "access_key_id": KEY, "secret_access_key": SECRET}

        def made() -> bool:
            assert server.poll() is None, "the server ended"
            try:
                urlopen(Request(f"{there['endpointurl']}/{NAME}", method="PUT"), timeout=5)
            except OSError:
                return False
            return True

        until(made, seconds=60.0)
        yield {"url": f"s3://{NAME}/store"} | there
    finally:
        server.terminate()
        server.wait()
