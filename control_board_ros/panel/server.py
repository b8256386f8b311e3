# SPDX-License-Identifier: Apache-2.0
"""The web server: the page, the robot's description and meshes, and one WebSocket per browser.

All but the first page requires the cookie, set by the address with the token.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import hashlib
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from control_board_ros.web_access import allowed_host, same_origin

from . import security
from .hub import Hub
from .recordings import REPORT_POLICY
from .robot import MEDIA

PAGE = Path(__file__).with_name("page")
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}
TOKEN_WANTED = (
    "Open the address printed by cbctl panel, which contains its token; a restart changes it.\n"
)
#: Close codes of WebSockets: "policy violation", "try again later".
REFUSED, FULL = 1008, 1013

Scope = dict[str, Any]
App = Callable[[Any, Any, Any], Awaitable[None]]


class Guard:
    """Admits requests with the token, from the panel's own pages, to this machine's names.

    Args:
        app: the guarded application.
        token: in the address, and in the cookie.
        cookie: its name.
        names: of this machine.
        policy: the Content-Security-Policy of the page.
    """

    def __init__(
        self, app: App, token: str, cookie: str, names: frozenset[str], policy: str
    ) -> None:
        self._app, self._token, self._cookie, self._names = app, token, cookie, names
        self._headers = [
            (name.lower().encode(), value.encode())
            for name, value in (security.HEADERS | {"Content-Security-Policy": policy}).items()
        ]

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        status, why = self._refusal(connection)
        if not status:
            await self._app(scope, receive, self._with_headers(send))
        elif scope["type"] == "websocket":
            await WebSocket(scope, receive, send).close(REFUSED, why)
        else:
            refusal = PlainTextResponse(why, status)
            await refusal(scope, receive, self._with_headers(send))

    def _refusal(self, connection: HTTPConnection) -> tuple[int, str]:
        """Status and reason to refuse a request; 0 if permitted."""
        headers = connection.headers
        host = headers.get("host")
        if not allowed_host(host, self._names):
            return 421, "The host name is not one of this machine; use its address.\n"
        if connection.scope["type"] == "websocket":
            if not same_origin(headers.get("origin"), host):
                return 403, "Only the panel's own page may connect.\n"
        elif connection.scope["method"] not in ("GET", "HEAD"):
            return 405, "Only GET.\n"
        token = security.cookie_of(headers.get("cookie"), self._cookie)
        if connection.url.path == "/":  # the cookie may be of an earlier panel
            token = connection.query_params.get("token", token)
        return (0, "") if security.is_token(token, self._token) else (403, TOKEN_WANTED)

    def _with_headers(self, send: Any) -> Any:
        async def send_with_headers(message: dict[str, Any]) -> None:
            if message["type"] == "http.response.start":
                headers = list(message.get("headers", ()))
                names = {name for name, _ in headers}  # a report has its own policy
                message["headers"] = headers + [h for h in self._headers if h[0] not in names]
            await send(message)

        return send_with_headers


def policy_of(page: str) -> str:
    """A Content-Security-Policy: own files only, and the page's import map by hash."""
    (imports,) = re.findall(r'<script type="importmap">(.*?)</script>', page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(imports.encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'self' 'sha256-{digest}'; style-src 'self'; "
        "img-src 'self' data: blob:; connect-src 'self'; form-action 'none'; base-uri 'none'; "
        "frame-ancestors 'none'"
    )


def make_app(
    hub: Hub, token: str, port: int, names: frozenset[str], report: Callable[[str], None]
) -> App:
    """The application.

    Args:
        hub: shared by the browsers.
        token: required token.
        port: of the server; part of the cookie's name.
        names: of this machine, beside localhost.
        report: called with log lines.
    """
    index = (PAGE / "index.html").read_text("utf-8")
    files = {
        path.relative_to(PAGE).as_posix(): path
        for path in PAGE.rglob("*")
        if path.is_file() and path.suffix in TYPES and path.name != "index.html"
    }
    cookie = f"control_board_panel_{port}"  # browsers separate them by host, not by port

    async def page(_: Request) -> Response:
        response = Response(index, media_type=TYPES[".html"])
        response.set_cookie(cookie, token, httponly=True, samesite="strict")
        return response

    async def file(request: Request) -> Response:
        path = files.get(request.path_params["path"])
        if path is None:
            return PlainTextResponse("no such file\n", 404)
        return FileResponse(path, media_type=TYPES[path.suffix])

    async def socket(websocket: WebSocket) -> None:
        if len(hub.state.browsers) >= security.MAX_BROWSERS:
            await websocket.close(FULL, f"{security.MAX_BROWSERS} browsers are connected already")
            return
        await websocket.accept()
        await serve(hub, websocket)

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        serving = asyncio.create_task(hub.run())
        serving.add_done_callback(lambda task: ended(task, report))
        yield
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)

    content = Content(hub)
    app = Starlette(
        routes=[
            Route("/", page),
            Route("/page/{path:path}", file),
            Route("/robot/{number:int}.urdf", content.urdf),
            Route("/mesh/{number:int}/{mesh}", content.mesh),
            Route("/report/{name}", content.report),
            WebSocketRoute("/ws", socket),
        ],
        lifespan=lifespan,
    )
    return Guard(app, token, cookie, names, policy_of(index))


class Content:
    """What the hub has found for a page: the robots of its boards, and reports of recordings."""

    def __init__(self, hub: Hub) -> None:
        self._state = hub.state

    def _robot(self, request: Request) -> Any:
        """The robot of the board with the number of a request."""
        number = request.path_params["number"]
        boards = self._state.boards.values()
        return next((board.robot for board in boards if board.number == number), None)

    async def urdf(self, request: Request) -> Response:
        robot = self._robot(request)
        if robot is None or not robot.urdf:
            return PlainTextResponse("no such robot\n", 404)
        return Response(robot.urdf, media_type="text/xml; charset=utf-8")

    async def mesh(self, request: Request) -> Response:
        robot = self._robot(request)
        mesh, _, ending = request.path_params["mesh"].partition(".")
        meshes = () if robot is None else robot.meshes
        known = re.fullmatch(r"[0-9]{1,5}", mesh) and int(mesh) < len(meshes)
        if not known or f".{ending}" != meshes[int(mesh)].suffix.lower():
            return PlainTextResponse("no such mesh\n", 404)
        path = meshes[int(mesh)]
        if not path.is_file():
            return PlainTextResponse("the mesh is gone\n", 404)
        return FileResponse(path, media_type=MEDIA[f".{ending}"])

    async def report(self, request: Request) -> Response:
        """A report of the panel's recordings, with a stricter policy than its page."""
        path = self._state.recordings.report(request.path_params["name"])
        if path is None or not path.is_file():
            return PlainTextResponse("no such report\n", 404)
        policy = {"Content-Security-Policy": REPORT_POLICY}
        return FileResponse(path, media_type=TYPES[".html"], headers=policy)


def ended(task: asyncio.Task[None], report: Callable[[str], None]) -> None:
    """Report an unexpected end of the hub."""
    if not task.cancelled() and (error := task.exception()) is not None:
        report(f"the panel has an error and receives no more boards: {error!r}; restart it")


async def serve(hub: Hub, websocket: WebSocket) -> None:
    """Serve one browser until it disconnects."""
    browser = hub.enter(name_of(websocket), websocket.query_params.get("tab", ""))
    writing = asyncio.create_task(browser.write(websocket))
    reading = asyncio.create_task(read(hub, browser, websocket))
    try:
        await asyncio.wait({writing, reading}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in (writing, reading):
            task.cancel()
        await asyncio.gather(writing, reading, return_exceptions=True)
        await hub.leave(browser)
    if browser.lost:
        with contextlib.suppress(RuntimeError, WebSocketDisconnect):  # already disconnected
            await websocket.close(REFUSED, "too many messages, or read too slowly")


async def read(hub: Hub, browser: Any, websocket: WebSocket) -> None:
    """Process its messages until it disconnects."""
    with contextlib.suppress(WebSocketDisconnect):
        while not browser.lost:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            hub.receive(browser, message.get("text") or "")


def name_of(websocket: WebSocket) -> str:
    """A browser's name for display: kind, device, address."""
    agent = websocket.headers.get("user-agent", "")
    kinds = ("Firefox", "Edg", "Chrome", "Safari")
    kind = next((kind for kind in kinds if kind in agent), "browser").replace("Edg", "Edge")
    device = "phone" if "Mobile" in agent else "desk"
    client = websocket.client
    return f"{kind} ({device}, {client.host if client else '?'})"
