"""The certificate of the twin that a session runs: which file it is, and who is served it."""

import asyncio
import hashlib
import json

import pytest

from tests.support.live import TOKEN, laid
from trunkline.ar.session import certificate as certified
from trunkline.ar.session.auth import HEADERS
from trunkline.ar.session.certificate import certificate_of
from trunkline.errors import InputError
from trunkline.report.certificate import page as written
from trunkline.twin.package import MANIFEST

ARM, PATH = b"<mujoco/>", "Runtime/Model/calibrated.xml"
FILES = {MANIFEST: json.dumps({"hybrid": {"arm": PATH}}).encode(), PATH: ARM}
OF_THIS = f"<code>{hashlib.sha256(ARM).hexdigest()}</code>".encode()
OF_ANOTHER = f"<code>{hashlib.sha256(b'another').hexdigest()}</code>".encode()


@pytest.mark.parametrize(
    ("beside", "in_artifacts", "expected"),
    [
        (None, None, b""),
        (None, OF_THIS, OF_THIS),
        (OF_THIS, None, OF_THIS),
        (OF_ANOTHER, OF_THIS, OF_THIS),
        (None, OF_ANOTHER, b""),
        (b"", b"", b""),
    ],
)
def test_the_certificate_is_that_of_the_package_s_arm_or_none(tmp_path, beside, in_artifacts, expected):
    package = tmp_path / "package_unity/twin.tgz"
    for place, content in zip(certified.PLACES, (beside, in_artifacts), strict=True):
        file = package.parent / place
        package.parent.mkdir(exist_ok=True)
        (tmp_path / "report").mkdir(exist_ok=True)
        if content is not None:
            file.write_bytes(content)
    assert certificate_of(package, FILES) == expected


def test_a_package_without_its_arm_is_one_line(tmp_path):
    with pytest.raises(InputError, match=f"{PATH}: found no such file"):
        certificate_of(tmp_path / "twin.tgz", {MANIFEST: FILES[MANIFEST]})


def test_its_policy_is_as_strict_as_the_page_s_own():
    assert certified.POLICY.startswith(written.POLICY)
    assert "sandbox allow-scripts" in certified.POLICY
    assert "allow-same-origin" not in certified.POLICY


def served(certificate, paths):
    """Status, headers and bytes of each path, with {name} in place of the certificate's, and that name."""

    async def session():
        async with laid(certificate=certificate) as here:
            headers = {"Authorization": f"Bearer {TOKEN}"}
            scene = await (await here.session.get(f"{here.url}/scene.json", headers=headers)).json()
            name, answers = scene.get("certificate", ""), {}
            for path in paths:
                answer = await here.session.get(here.url + path.format(name=name))
                answers[path] = answer.status, answer.headers, await answer.read()
            return name, answers

    return asyncio.run(session())


@pytest.mark.realtime
def test_who_has_the_token_is_served_the_certificate_alone_in_a_sandbox():
    name, answers = served(OF_THIS, ["/{name}"])
    status, headers, content = answers["/{name}"]
    assert (status, content) == (200, OF_THIS)
    assert len(name) > 30
    assert {key: headers[key] for key in HEADERS} == HEADERS | certified.HEADERS
    assert headers["Content-Type"] == "text/html; charset=utf-8"


HOSTILE = (
    "/certificate", "/certificate/", "/certificate/x", "/certificate/%F0%9F%98%80", "/certificate/..%2fscene.json",
    "/certificate.html", "/{name}x", "/{name}/..", "/{name}/%2e%2e/%2e%2e/pyproject.toml",
)  # fmt: skip


@pytest.mark.realtime
def test_under_any_other_name_nothing_is_served():
    _, answers = served(OF_THIS, HOSTILE)
    assert {status for status, _, _ in answers.values()} <= {404, 503}  # 503: of a page that is not built
    assert not [path for path, (_, _, content) in answers.items() if OF_THIS in content]


@pytest.mark.realtime
def test_without_a_certificate_there_is_no_link_and_no_route():
    name, answers = served(b"", ["/certificate/", "/certificate/x"])
    assert name == ""
    assert {status for status, _, _ in answers.values()} <= {404, 503}
