"""What a live session serves to a browser before it is connected: the page's files, and to whom has the token the scene
and the twin's certificate. Nothing else of the disk is served."""

import gzip
import json
from collections.abc import Callable
from pathlib import Path

from aiohttp import web

from trunkline.ar.session import certificate as certified
from trunkline.ar.session.auth import HEADERS, Origins, make_token, same
from trunkline.ar.session.connections import IdleConnections

TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
ABSENT = b"<!doctype html><title>Trunkline</title><p>error: the page is not built: `client/` makes it</p>\n"


class Routes:
    """scene: as `scene.scene` has it. folder: of the page. certificate: the twin's, empty without one. A link sends no
    token, so the certificate has a name that nobody guesses, which the scene tells."""

    def __init__(
        self, origins: Origins, token: str, scene: dict, folder: Path, log: Callable[[str], None], certificate: bytes
    ) -> None:
        self._origins, self._token, self._log = origins, token, log
        self._certificate, self._secret = certificate, make_token()
        if certificate:
            scene = scene | {"certificate": f"certificate/{self._secret}"}
        self._scene = json.dumps(scene, separators=(",", ":")).encode()
        self._zipped = gzip.compress(self._scene)
        self._page = read_page(folder)
        self.idle = IdleConnections()

    def add_routes(self, app: web.Application) -> None:
        """After all others: the page's takes every name."""
        app.router.add_get("/scene.json", self._get_scene)
        app.router.add_get("/certificate/{secret}", self._get_certificate)
        app.router.add_get("/{name:.*}", self._get_page)

    @web.middleware
    async def guarded(self, request: web.Request, handler) -> web.StreamResponse:
        """Refuse what comes from elsewhere; every answer has HEADERS, every error is a line."""
        reason = self._origins.fault(request.headers.get("Host"), request.headers.get("Origin"), False)
        if reason:
            self._log(f"refused {request.remote}: {reason}")
            return web.Response(status=403, text=f"error: {reason}\n", headers=HEADERS)
        transport = request.transport
        try:
            self.idle.busy.add(transport)
            response = await handler(request)
        except web.HTTPException as error:
            if error.status != web.HTTPNotFound.status_code:  # browsers ask for icons
                self._log(f"refused {request.remote}: {request.method} {request.path}: {error.status} {error.reason}")
            return web.Response(status=error.status, text=f"error: {error.reason}\n", headers=HEADERS)
        except Exception as error:
            self._log(f"error: {request.remote} {request.path}: {type(error).__name__}: {error}")
            return web.Response(status=500, text="error: the server failed; its terminal says how\n", headers=HEADERS)
        finally:
            self.idle.busy.discard(transport)
        if not response.prepared:
            for name, value in HEADERS.items():
                response.headers.setdefault(name, value)
        return response

    async def _get_page(self, request: web.Request) -> web.Response:
        name = request.match_info["name"] or "index.html"
        if not self._page:
            return web.Response(status=503, body=ABSENT, content_type="text/html")
        if name not in self._page:
            raise web.HTTPNotFound
        return web.Response(body=self._page[name], content_type=TYPES[Path(name).suffix], charset="utf-8")

    async def _get_certificate(self, request: web.Request) -> web.Response:
        if not same(request.match_info["secret"], self._secret):
            raise web.HTTPNotFound
        headers = certified.HEADERS
        return web.Response(body=self._certificate, content_type="text/html", charset="utf-8", headers=headers)

    async def _get_scene(self, request: web.Request) -> web.Response:
        scheme, _, token = request.headers.get("Authorization", "").partition(" ")
        if scheme != "Bearer" or not same(token, self._token):
            raise web.HTTPUnauthorized
        zipped = "gzip" in request.headers.get("Accept-Encoding", "")
        encoding = {"Content-Encoding": "gzip"} if zipped else {}
        body = self._zipped if zipped else self._scene
        return web.Response(body=body, content_type="application/json", headers=encoding)


def read_page(folder: Path) -> dict[str, bytes]:
    """Contents by name of the files that a page may have; none where there is no index.html."""
    files = [file for file in folder.glob("*") if file.suffix in TYPES and file.is_file() and not file.is_symlink()]
    contents = {file.name: file.read_bytes() for file in files}
    return contents if "index.html" in contents else {}
