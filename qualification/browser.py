"""A headless Chromium over its own debugging protocol: a page, its keys, its mouse, and how often it draws."""

import asyncio
import contextlib
import os
import signal
import tempfile
import time
from collections.abc import AsyncIterator
from pathlib import Path

from aiohttp import ClientSession, WSMsgType

from trunkline.errors import InputError

FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--ignore-gpu-blocklist", "--disable-background-networking", "--remote-debugging-port=0")  # fmt: skip
PATIENCE = 30.0  # s for the browser to come
LOOKS = 0.02  # s between looks at a page
# As root, a browser would draw before all else; as a user has it, it may not.
AS_USER = ("setpriv", "--bounding-set=-sys_nice", "--inh-caps=-sys_nice") if os.geteuid() == 0 else ()
# a frame counts once something was drawn in it, by whatever call of WebGL
COUNT = """
globalThis.drawn = 0;
let draws = false;
for (const kind of [WebGLRenderingContext, WebGL2RenderingContext]) {
  for (const name of Object.getOwnPropertyNames(kind.prototype).filter((name) => name.startsWith("draw"))) {
    const was = Object.getOwnPropertyDescriptor(kind.prototype, name).value;
    if (typeof was !== "function") continue;
    kind.prototype[name] = function (...args) { draws = true; return was.apply(this, args); };
  }
}
const request = globalThis.requestAnimationFrame.bind(globalThis);
globalThis.requestAnimationFrame = (draw) => request((time) => {
  draws = false;
  draw(time);
  globalThis.drawn += draws;
});
"""


class Page:
    """What is asked of it is answered by its browser."""

    def __init__(self, socket) -> None:
        self._socket, self._number, self._waiting = socket, 0, {}
        self._reading = asyncio.create_task(self._read())

    async def _read(self) -> None:
        async for message in self._socket:
            if message.type is not WSMsgType.TEXT:
                continue
            told = message.json()
            if told.get("id") in self._waiting:
                self._waiting.pop(told["id"]).set_result(told)

    async def ask(self, method: str, **parameters) -> dict:
        """
        Raises:
            InputError: the browser refuses it.
        """
        self._number += 1
        answer = self._waiting[self._number] = asyncio.get_running_loop().create_future()
        await self._socket.send_json({"id": self._number, "method": method, "params": parameters})
        told = await answer
        if "error" in told:
            raise InputError(f"browser, {method}: {told['error']['message']}")
        return told["result"]

    async def value(self, expression: str):
        """Of JavaScript in the page."""
        return (await self.ask("Runtime.evaluate", expression=expression))["result"].get("value")

    async def until(self, expression: str, what: str, seconds: float) -> None:
        """
        Raises:
            InputError: it does not become true in so many s.
        """
        end = time.monotonic() + seconds
        while not await self.value(expression):
            if time.monotonic() > end:
                says = await self.value("document.querySelector('#status')?.innerText")
                raise InputError(f"{what}: not reached in {seconds:g} s; the page says {says!r}")
            await asyncio.sleep(LOOKS)

    async def key(self, code: str, kind: str = "") -> None:
        """Pressed and let go, or only what `kind` says of it."""
        for one in [kind] if kind else ["rawKeyDown", "keyUp"]:
            await self.ask("Input.dispatchKeyEvent", type=one, code=code)

    async def mouse(self, kind: str, x: float, y: float) -> None:
        await self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    async def place(self, name: str, share: float = 0.5) -> tuple[float, float]:
        """Of the element `name`, at a share of its width, in pixels."""
        box = f"document.querySelector('{name}').getBoundingClientRect()"
        x, y, wide, high = [await self.value(f"{box}.{side}") for side in ("x", "y", "width", "height")]
        return x + share * wide, y + high / 2

    async def click(self, name: str) -> None:
        place = await self.place(name)
        await self.mouse("mousePressed", *place)
        await self.mouse("mouseReleased", *place)


@contextlib.asynccontextmanager
async def browsing(url: str, size: tuple[int, int], nice: int = 0) -> AsyncIterator[Page]:
    """A page at `url`, its window of `size` pixels, in a browser of its own that is as `nice` to other processes.

    Raises:
        InputError: there is no browser.
    """
    program = os.environ.get("TRUNKLINE_BROWSER", "/usr/bin/chromium")
    if not Path(program).is_file():
        raise InputError(f"{program}: no such browser; `make browser` installs one, TRUNKLINE_BROWSER names another")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        window = f"--window-size={size[0]},{size[1]}"
        browser = await asyncio.create_subprocess_exec(
            *AS_USER, "nice", "-n", str(nice), program, *FLAGS, f"--user-data-dir={folder}", window, "about:blank",
            start_new_session=True, stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
        )  # fmt: skip
        try:
            port = await asyncio.wait_for(_port(Path(folder) / "DevToolsActivePort"), PATIENCE)
            async with ClientSession() as session:
                targets = await (await session.get(f"http://127.0.0.1:{port}/json")).json(content_type=None)
                address = next(one["webSocketDebuggerUrl"] for one in targets if one["type"] == "page")
                async with session.ws_connect(address, max_msg_size=0) as socket:
                    page = Page(socket)
                    for domain in ("Page", "Runtime"):
                        await page.ask(f"{domain}.enable")
                    await page.ask("Page.addScriptToEvaluateOnNewDocument", source=COUNT)
                    await page.ask("Page.navigate", url=url)
                    yield page
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(browser.pid, signal.SIGKILL)
            await browser.wait()


async def _port(file: Path) -> int:
    while not (file.is_file() and file.read_text().strip()):
        await asyncio.sleep(0.05)
    return int(file.read_text().splitlines()[0])
