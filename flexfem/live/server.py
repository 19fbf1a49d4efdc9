"""The server of a live page, for one browser on this machine."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import secrets
import socket
import webbrowser
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import jinja2

from flexfem.files.toml import PathLike
from flexfem.importing.drawings import NO_READING, Reading
from flexfem.live.elements import Elements
from flexfem.live.session import Session
from flexfem.questions.handling import plain
from flexfem.refused import BadInput
from flexfem.sources import PACKAGE

HOST = "127.0.0.1"
TEMPLATES = Path(__file__).with_name("templates")
OF_PAGES = PACKAGE / "page" / "templates"  # the drawing that a hand moves is that of report pages
WATCH = 0.25  # s, between two looks at the file
SETTLED = 0.5  # s without a change after which finite elements start
ENDING = 0.5  # s, between two looks of an open page at whether the server ends
GRACE = 5  # s, after which requests are not waited for when the server ends
LARGEST_REQUEST = 2**16  # bytes
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


def serve(
    file: PathLike,
    *,
    reading: Reading = NO_READING,
    port: int = 0,
    no_browser: bool = False,
) -> None:
    """Serve a page on a file that answers while its numbers are changed, until it is stopped.

    The page is at an address with a token on this machine alone. It has the drawing, the key
    results and a slider for every number. A moved slider, or a saved file, is answered by the
    analytic model at once and by finite elements in the background.

    Parameters
    ----------
    file : path
        Mechanism or stage file, or a drawing.
    reading : Reading
        Of a drawing: how it is read.
    port : int
        Port of the address; 0 takes a free one.
    no_browser : bool
        Print the address without opening it.

    Raises
    ------
    BadInput
        The file cannot be read or answered, a package is missing, or the port is taken.
    """
    try:
        import uvicorn
    except ImportError:
        raise BadInput("live needs more packages: pip install 'flexfem[live]'") from None
    page = LivePage(Session(file, reading))
    with _bound(port) as bound:
        page.port = bound.getsockname()[1]
        print(f"{page.address}  (stop with Ctrl-C)", flush=True)
        if not no_browser:
            webbrowser.open(page.address)
        config = uvicorn.Config(
            page.application(),
            log_level="critical",
            lifespan="on",
            timeout_graceful_shutdown=GRACE,
        )
        server = uvicorn.Server(config)
        page.is_ending = lambda: server.should_exit
        try:
            with contextlib.suppress(KeyboardInterrupt):
                server.run(sockets=[bound])
        finally:
            page.elements.close()


def _bound(port: int) -> socket.socket:
    """Return a socket on this machine alone. Raises BadInput for a port that is taken."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((HOST, port))
        bound.listen()  # so that a browser that is opened before the server runs waits for it
    except (OSError, OverflowError) as error:
        bound.close()
        raise BadInput(f"port {port}: {error}, expected a free port, or 0") from None
    return bound


class LivePage:
    """The page of a session: its address, what it sends, and what it is asked."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.token = secrets.token_urlsafe(16)
        self.port = 0
        self.elements = Elements()
        self.is_ending: Callable[[], bool] = lambda: False
        self._busy = asyncio.Lock()  # one change of the session at a time, also from several pages
        self._listeners = set[asyncio.Queue[dict[str, Any]]]()
        self._asked: asyncio.Task[None] | None = None
        self._version = 0
        self._of_elements: dict[str, Any] = {"state": "waiting"}

    @property
    def address(self) -> str:
        """Address of the page, with its token."""
        return f"http://{HOST}:{self.port}/{self.token}/"

    def application(self) -> Any:
        """Return the application that answers requests."""
        from starlette.applications import Starlette
        from starlette.routing import Route

        at = f"/{self.token}"
        routes = [
            Route(f"{at}/", self._page),
            Route(f"{at}/live.css", self._style),
            Route(f"{at}/live.js", self._script),
            Route(f"{at}/handle.js", self._handle),
            Route(f"{at}/handle.css", self._handle_style),
            Route(f"{at}/events", self._events),
            Route(f"{at}/change", self._change, methods=["POST"]),
            Route(f"{at}/save", self._save, methods=["POST"]),
        ]
        return Guard(Starlette(routes=routes, lifespan=self._lifespan), self)

    @contextlib.asynccontextmanager
    async def _lifespan(self, _: Any) -> AsyncIterator[None]:
        watching = asyncio.create_task(self._watch())
        self._ask_elements()
        yield
        watching.cancel()
        if self._asked is not None:
            self._asked.cancel()
        self.elements.close()

    async def _page(self, _: Any) -> Any:
        from starlette.responses import HTMLResponse

        environment = jinja2.Environment(
            loader=jinja2.FileSystemLoader(TEMPLATES),
            autoescape=True,
            undefined=jinja2.StrictUndefined,
        )
        page = environment.get_template("live.html")
        return HTMLResponse(page.render(title=self.session.title, file=str(self.session.path)))

    async def _style(self, _: Any) -> Any:
        return _file(TEMPLATES / "live.css", "text/css")

    async def _script(self, _: Any) -> Any:
        return _file(TEMPLATES / "live.js", "text/javascript")

    async def _handle(self, _: Any) -> Any:
        return _file(OF_PAGES / "handle.js", "text/javascript")

    async def _handle_style(self, _: Any) -> Any:
        return _file(OF_PAGES / "handle.css", "text/css")

    async def _events(self, _: Any) -> Any:
        from starlette.responses import StreamingResponse

        queue = asyncio.Queue[dict[str, Any]]()
        self._listeners.add(queue)
        queue.put_nowait(self._state())
        return StreamingResponse(self._sent(queue), media_type="text/event-stream")

    async def _sent(self, queue: asyncio.Queue[dict[str, Any]]) -> AsyncIterator[str]:
        try:
            while not self.is_ending():
                try:
                    content = await asyncio.wait_for(queue.get(), ENDING)
                except TimeoutError:
                    continue
                yield f"data: {json.dumps(content, allow_nan=False)}\n\n"
        finally:
            self._listeners.discard(queue)

    async def _change(self, request: Any) -> Any:
        from starlette.responses import JSONResponse

        values = _numbers(await _body(request))
        if values is None:
            return JSONResponse({"error": "expected finite numbers by key path"}, 400)
        async with self._busy:
            await asyncio.to_thread(self.session.change, values)
            self._changed()
        return JSONResponse({"version": self._version})

    async def _save(self, _: Any) -> Any:
        from starlette.responses import JSONResponse

        async with self._busy:
            try:
                written = await asyncio.to_thread(self.session.save)
            except BadInput as refused:
                return JSONResponse({"error": str(refused)}, 400)
            finally:
                self._changed()
        return JSONResponse({"written": written})

    async def _watch(self) -> None:
        """Answer again when the file was written or removed."""
        seen = self.session.read_at
        while True:
            await asyncio.sleep(WATCH)
            before = seen
            seen = self.session.stamp()
            if seen != before:  # an editor may be writing it, or replacing it
                continue
            async with self._busy:
                if seen != self.session.read_at:
                    await asyncio.to_thread(self.session.reload)
                    self._changed()

    def _changed(self) -> None:
        """Send the state, and ask finite elements where it has an answer."""
        self._version += 1
        if self.session.fault is None:
            self._of_elements = {"state": "waiting"}
            self._ask_elements()
        self._send(self._state())

    def _ask_elements(self) -> None:
        if self._asked is not None:
            self._asked.cancel()
        self._asked = asyncio.create_task(self._answer_by_elements())

    async def _answer_by_elements(self) -> None:
        """Answer the last numbers that have an answer; the task is cancelled where newer ones do."""
        await asyncio.sleep(SETTLED)

        def report(kind: str, content: Any) -> None:
            rows = [row._asdict() for row in content] if kind == "rows" else []
            text = "" if kind == "rows" else content
            self._of_elements = {"state": kind, "text": text, "rows": rows}
            self._send({"version": self._version, "elements": self._of_elements})

        report("progress", "meshing")
        await self.elements.answer(self.session.mechanism, report)

    def _state(self) -> dict[str, Any]:
        session = self.session
        answer = session.answer
        fault = session.fault
        return {
            "version": self._version,
            "title": session.title,
            "can_save": session.can_save,
            "sliders": [slider._asdict() for slider in session.sliders],
            "values": session.asked,
            "drawing": plain(answer.drawing),
            "handled": plain(answer.handled),
            "rows": [row._asdict() for row in answer.rows],
            "doubts": answer.doubts,
            "seconds": answer.seconds,
            "fault": None if fault is None else fault._asdict(),
            "elements": self._of_elements,
        }

    def _send(self, content: dict[str, Any]) -> None:
        for queue in self._listeners:
            queue.put_nowait(content)


class Guard:
    """Refuses requests that do not come from the page itself.

    Host and origin must be those of the address: else a page of another site could ask, by a name
    that leads to this machine.
    """

    def __init__(
        self,
        inner: Any,
        page: LivePage,
    ) -> None:
        self._inner = inner
        self._page = page

    async def __call__(
        self,
        scope: Any,
        receive: Any,
        send: Any,
    ) -> None:
        if scope["type"] == "lifespan":
            await self._inner(scope, receive, send)
            return
        if scope["type"] != "http" or not self._is_own(scope):
            from starlette.responses import PlainTextResponse

            await PlainTextResponse("not found", 404, HEADERS)(scope, receive, send)
            return

        async def with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                added = [(name.lower().encode(), text.encode()) for name, text in HEADERS.items()]
                message = {**message, "headers": [*message["headers"], *added]}
            await send(message)

        await self._inner(scope, receive, with_headers)

    def _is_own(self, scope: Any) -> bool:
        headers = {
            name.decode("latin-1"): text.decode("latin-1") for name, text in scope["headers"]
        }
        own = f"{HOST}:{self._page.port}"
        origin = headers.get("origin")
        return headers.get("host") == own and origin in (None, f"http://{own}")


def _file(path: Path, kind: str) -> Any:
    """Return the answer with the text of a file of the package."""
    from starlette.responses import Response

    return Response(path.read_text(encoding="utf-8"), media_type=kind)


async def _body(request: Any) -> bytes:
    """Return the content of a request, "" of one that is too long."""
    found = b""
    async for part in request.stream():
        found += part
        if len(found) > LARGEST_REQUEST:
            return b""
    return found


def _numbers(body: bytes) -> dict[str, float] | None:
    """Return the numbers by key path of a request; None for anything else."""
    try:
        given = json.loads(body)
        numbers = {str(path): float(value) for path, value in given.items()}
    except (ValueError, TypeError, AttributeError, OverflowError):
        return None
    return numbers if all(map(math.isfinite, numbers.values())) else None
