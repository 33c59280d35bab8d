"""The server of the page: on this machine alone unless asked otherwise, for reading alone, with no path into the disk.

A request names the page, its script, or a picture that the page has offered. Nothing in an address is taken for the
name of a file.
"""

from __future__ import annotations

import errno
import hashlib
import ipaddress
import os
import platform
import re
import socket
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs, unquote

from ..errors import OutputError
from .page import Watch

__all__ = ["HERE", "Server"]

HERE = "127.0.0.1"
PICTURE = re.compile(r"/picture/((?:[\d-]+/)?[a-z0-9-]+\.(?:svg|png))")
POLICY = ("default-src 'none'; img-src 'self' data:; style-src 'unsafe-inline'; script-src 'self'; connect-src 'self'; "
          "base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
HTML, SCRIPT, TEXT = "text/html; charset=utf-8", "text/javascript; charset=utf-8", "text/plain; charset=utf-8"


class Server(ThreadingHTTPServer):
    """Serves a watch at a host and a port; port 0 takes a free one.

    Parameters
    ----------
    watch: what is shown.
    host: name or number of the address to listen at.   port: of it.

    Raises
    ------
    OutputError
        The port is taken, or the address is none of this machine.
    """

    daemon_threads = True
    allow_reuse_address = os.name != "nt"  # where it would let two servers have one port

    def __init__(self, watch: Watch, host: str = HERE, port: int = 8765) -> None:
        self.watch, self.host = watch, host
        self.script = files("skfsink.watch").joinpath("watch.js").read_bytes()
        try:
            family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            self.address_family = family
            super().__init__((str(address[0]), port), Handler)
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise OutputError(f"port {port} of {host} is taken, perhaps by another skfsink watch: take another "
                                  f"--port, or --port 0 for a free one") from None
            raise OutputError(f"cannot listen at {host}, port {port}: {error.strerror or error}; --host names an "
                              f"address of this machine, --port one from 1024 on") from None

    @property
    def local(self) -> bool:
        """Whether only this machine can reach it."""
        return ipaddress.ip_address(str(self.server_address[0])).is_loopback

    @property
    def url(self) -> str:
        """Address of the page."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.server_address[1]}/"

    def answers_to(self, name: str) -> bool:
        """Whether the name that a browser has asked is one of this server.

        A page of elsewhere may have its own name lead here; it cannot do so with `localhost` or with a number. Where
        others may ask, numbers and the names of this machine are let in as well.
        """
        name = name.lower().rstrip(".")
        if name == "localhost":
            return True
        try:
            return ipaddress.ip_address(name.strip("[]")).is_loopback or not self.local
        except ValueError:
            return not self.local and name in {self.host.lower(), platform.node().lower(), socket.getfqdn().lower()}

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away in the middle of an answer is no error."""


class Handler(BaseHTTPRequestHandler):
    """Answers one browser."""

    server: Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "skfsink-watch", ""
    timeout = 60.0

    def do_GET(self) -> None:
        """The page, its script, or a picture."""
        if not self.server.answers_to(self._name()):
            self._say(HTTPStatus.FORBIDDEN, f"this page is shown as {self.server.url}, not under another name")
            return
        path, _, query = self.path.partition("?")
        path = unquote(path)
        if path == "/":
            asked = [int(key) for key in parse_qs(query).get("run", [])[:100] if re.fullmatch("[0-9]{1,9}", key)]
            self._send(self.server.watch.page(asked).encode(), HTML)
        elif path == "/watch.js":
            self._send(self.server.script, SCRIPT)
        elif picture := PICTURE.fullmatch(path):
            drawn = self.server.watch.picture(picture[1])
            if drawn is None:
                why = self.server.watch.failure(picture[1])
                self._say(HTTPStatus.SERVICE_UNAVAILABLE if why else HTTPStatus.NOT_FOUND, why or "no such picture")
            else:
                self._send(drawn.content, drawn.kind)
        else:
            self._say(HTTPStatus.NOT_FOUND, "there is nothing at this address")

    do_HEAD = do_GET

    def _name(self) -> str:
        """The host that was asked, without its port."""
        asked = self.headers.get("Host", "")
        return asked.rpartition(":")[0] if re.search(r":\d*$", asked) and not asked.endswith("]") else asked

    def _send(self, content: bytes, kind: str) -> None:
        tag = f'"{hashlib.sha256(content).hexdigest()[:32]}"'
        known = tag in self.headers.get("If-None-Match", "")
        self._answer(HTTPStatus.NOT_MODIFIED if known else HTTPStatus.OK, b"" if known else content, kind, tag)

    def _say(self, status: HTTPStatus, text: str) -> None:
        self._answer(status, (text + "\n").encode(), TEXT)

    def _answer(self, status: HTTPStatus, content: bytes, kind: str, tag: str = "") -> None:
        self.send_response(status)
        for name, value in (("Content-Type", kind), ("Content-Length", str(len(content))), ("ETag", tag),
                            ("Cache-Control", "no-cache"), ("Content-Security-Policy", POLICY),
                            ("X-Content-Type-Options", "nosniff"), ("Referrer-Policy", "no-referrer"),
                            ("Cross-Origin-Resource-Policy", "same-origin")):
            if value and not (status == HTTPStatus.NOT_MODIFIED and name.startswith("Content-")):
                self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Nothing is said of requests."""
