"""The certificate of the twin that a session runs: the page that the stage `report` has written of it."""

import hashlib
from pathlib import Path

from trunkline.twin.package import data_of, manifest_of

PLACES = ("certificate.html", "../report/certificate.html")  # beside a package that was handed on, and in artifacts/
# It may run its own script and show its own pictures, and is nobody's page: of an origin of its own, without requests.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'; sandbox allow-scripts"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "Cross-Origin-Opener-Policy": "unsafe-none",  # browsers refuse any other of a sandbox; the link has no opener
}


def certificate_of(package: Path, files: dict[str, bytes]) -> bytes:
    """The certificate in the first of PLACES, from the folder of the package at `package`, that names the SHA-256 of
    the calibrated arm in the package's `files`; empty where none does: another twin's is not shown.

    Raises:
        InputError: the package has no calibrated arm.
    """
    arm = data_of(files, manifest_of(files).block("hybrid").text("arm"))
    digest = hashlib.sha256(arm).hexdigest().encode()
    for place in PLACES:
        file = package.resolve().parent / place
        page = file.read_bytes() if file.is_file() else b""
        if digest in page:
            return page
    return b""
