"""A connection to the service that stays open from one request to the next."""

from __future__ import annotations

import base64
import http.client
import ssl
import threading
import urllib.parse
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from email.message import Message
from typing import TypeAlias

HttpConnection: TypeAlias = http.client.HTTPConnection
LOST = (ConnectionError, http.client.RemoteDisconnected)
"""What a request meets on a connection that the peer has closed meanwhile."""


@dataclass(frozen=True)
class Request:
    """A request; `target` is its path and query."""

    method: str
    target: str
    content: bytes | None
    headers: Mapping[str, str]


@dataclass(frozen=True)
class Reply:
    """A whole answer."""

    status: int
    reason: str
    headers: Message
    content: bytes


class Connection:
    """Sends requests to the server at `url`, through the proxy that the environment names, if
    any (as urllib understands `http_proxy`, `https_proxy` and `no_proxy`).

    One connection stays open. Threads may share this object: a request that finds it in use
    opens another one.
    """

    def __init__(self, url: str, timeout_s: float, context: ssl.SSLContext | None) -> None:
        self._idle: HttpConnection | None = None
        self._lock = threading.Lock()
        parts = urllib.parse.urlsplit(url)
        if parts.scheme not in ("http", "https"):
            raise ValueError(f"the address of a service starts with http:// or https://: {url}")
        if not parts.hostname:
            raise ValueError(f"the address of the service names no host: {url}")
        self._is_secure = parts.scheme == "https"
        self._host, self._port = parts.hostname, parts.port
        self._origin = f"{parts.scheme}://{parts.netloc}"
        self._proxy = _proxy(parts)
        self._timeout_s = timeout_s
        self._context = context

    def send(self, request: Request) -> Reply:
        """Sends a request and returns its answer. Raises OSError or HTTPException without one."""
        idle = self._take()
        if idle is not None:
            try:
                return self._exchange(idle, request)
            except LOST:
                pass  # closed while it was idle, as servers do
        return self._exchange(self._connect(), request)

    @contextmanager
    def stream(self, request: Request) -> Iterator[http.client.HTTPResponse]:
        """Sends a request on its own connection; yields its answer, which may not end."""
        connection = self._connect()
        try:
            self._request(connection, request)
            yield connection.getresponse()
        finally:
            connection.close()

    def close(self) -> None:
        """Closes the connection; a later request opens it again."""
        idle = self._take()
        if idle is not None:
            idle.close()

    def __del__(self) -> None:
        self.close()

    def _take(self) -> HttpConnection | None:
        with self._lock:
            idle, self._idle = self._idle, None
        return idle

    def _keep(self, connection: HttpConnection) -> None:
        with self._lock:
            if self._idle is None:
                self._idle = connection
                return
        connection.close()

    def _exchange(self, connection: HttpConnection, request: Request) -> Reply:
        try:
            self._request(connection, request)
            answer = connection.getresponse()
            content = answer.read()
        except BaseException:
            connection.close()
            raise
        if answer.will_close:
            connection.close()
        else:
            self._keep(connection)
        return Reply(answer.status, answer.reason, answer.headers, content)

    def _request(self, connection: HttpConnection, request: Request) -> None:
        target, headers = request.target, dict(request.headers)
        if self._proxy is not None and not self._is_secure:
            target = self._origin + target
            headers |= _authorization(self._proxy)
        connection.request(request.method, target, request.content, headers)

    def _connect(self) -> HttpConnection:
        host, port = self._host, self._port
        if self._proxy is not None:
            host, port = self._proxy.hostname or "", self._proxy.port
        if not self._is_secure:
            return http.client.HTTPConnection(host, port, timeout=self._timeout_s)
        secure = http.client.HTTPSConnection(
            host, port, timeout=self._timeout_s, context=self._context
        )
        if self._proxy is not None:
            secure.set_tunnel(self._host, self._port, _authorization(self._proxy))
        return secure


def _proxy(parts: urllib.parse.SplitResult) -> urllib.parse.SplitResult | None:
    """Returns the proxy for a server; None if it is reached directly."""
    proxy = urllib.request.getproxies().get(parts.scheme)
    if not proxy or urllib.request.proxy_bypass(parts.netloc.rpartition("@")[2]):
        return None
    return urllib.parse.urlsplit(proxy if "://" in proxy else f"http://{proxy}")


def _authorization(proxy: urllib.parse.SplitResult) -> dict[str, str]:
    """Returns the header with the name and the password in the address of a proxy."""
    if proxy.username is None:
        return {}
    unquote = urllib.parse.unquote
    user = f"{unquote(proxy.username)}:{unquote(proxy.password or '')}"
    return {"Proxy-Authorization": f"Basic {base64.b64encode(user.encode()).decode()}"}
