"""Fixtures: the program `offbd` of the same build, recordings that it makes, and a service."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

PROGRAM = os.environ["OFFBD"]


def run_program(*arguments: str | Path) -> str:
    """Runs `offbd` and returns what it prints."""
    done = subprocess.run([PROGRAM, *arguments], check=True, capture_output=True, text=True)
    return done.stdout


def judged_by_program(asset: Path, session: Path, *more: str) -> list[dict[str, Any]]:
    """Returns the lines of `offbd replay --format json`."""
    text = run_program("replay", "--format", "json", "--asset", asset, session, *more)
    return [json.loads(line) for line in text.splitlines()]


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with rig.json, healthy.csv, calibrated.json and sick.csv, all made by `offbd`."""
    made = tmp_path_factory.mktemp("recordings")
    healthy, sick, rig = made / "healthy.csv", made / "sick.csv", made / "rig.json"
    simulate = ("simulate", "--reference", "lissajous", "--seconds", "60")
    run_program(*simulate, "--rig", rig, "-o", healthy)
    run_program("simulate", "--seed", "2", "--fault", "x_servo:dead@20", "-o", sick)
    run_program("calibrate", "--asset", rig, healthy, "-o", made / "calibrated.json")
    return made


class Service:
    """A running `offbd serve`, which can be killed and started again."""

    def __init__(self, data: Path) -> None:
        self.data = data
        self.listen = "127.0.0.1:0"
        self.start()

    def start(self) -> None:
        command = [PROGRAM, "serve", "--listen", self.listen, "--log-format", "json", "--data"]
        self.process = subprocess.Popen([*command, str(self.data)], stderr=subprocess.PIPE)
        assert self.process.stderr is not None
        for line in self.process.stderr:
            entry = json.loads(line)
            if entry.get("message") == "serving":
                self.listen = entry["address"]
                break
        else:
            raise AssertionError("the service does not start")
        # Somebody must read the log, or the service would wait for room in the pipe.
        self.reader = threading.Thread(target=self.process.stderr.read)
        self.reader.start()

    @property
    def url(self) -> str:
        return f"http://{self.listen}"

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        self.reader.join()
        assert self.process.stderr is not None
        self.process.stderr.close()


class Listener:
    """Serves each connection to its own port."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self.accept, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.listener.getsockname()[1]}"

    def accept(self) -> None:
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            self.serve(connection)

    def serve(self, connection: socket.socket) -> None:
        raise NotImplementedError


class Peer(Listener):
    """Answers the next requests itself, each with the bytes of a list, or with silence if they
    are None, and passes later ones on to the service."""

    def __init__(self, service: Service | None = None) -> None:
        self.service = service
        self.answers: list[bytes | None] = []
        self.silent: list[socket.socket] = []
        super().__init__()

    def serve(self, connection: socket.socket) -> None:
        try:
            if self.is_answered(connection):
                connection.close()
        except OSError:
            connection.close()  # a client that has given up

    def is_answered(self, connection: socket.socket) -> bool:
        request = read_request(connection)
        answer = self.answers.pop(0) if self.answers else self.answer_of_service(request)
        if answer is None:
            self.silent.append(connection)
            return False
        connection.sendall(answer)
        return True

    def answer_of_service(self, request: bytes) -> bytes:
        assert self.service is not None
        host, port = self.service.listen.rsplit(":", 1)
        with socket.create_connection((host, int(port))) as upstream:
            upstream.sendall(as_last(request))
            return read_all(upstream)

    def close(self) -> None:
        self.listener.close()
        for connection in self.silent:
            connection.close()


def answered(status: str, body: str, kind: str = "text/html", cut: int | None = None) -> bytes:
    """An answer as it is on the line; `cut` bytes of its body are missing."""
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n"
    whole = body if cut is None else body[:-cut]
    return (head + "Connection: close\r\n\r\n" + whole).encode()


def problem(status: str, slug: str) -> bytes:
    """A refusal of the service."""
    body = {"type": f"urn:offbd:problem:{slug}", "title": slug, "status": int(status[:3])}
    return answered(status, json.dumps(body), "application/problem+json")


def read_request(connection: socket.socket) -> bytes:
    data = b""
    while b"\r\n\r\n" not in data:
        data += received(connection)
    head, _, body = data.partition(b"\r\n\r\n")
    length = 0
    for line in head.split(b"\r\n"):
        name, _, value = line.partition(b":")
        if name.lower() == b"content-length":
            length = int(value)
    while len(body) < length:
        body += received(connection)
    return head + b"\r\n\r\n" + body


def as_last(request: bytes) -> bytes:
    """The request, with which the client asks for the end of the connection."""
    line, _, rest = request.partition(b"\r\n")
    return line + b"\r\nConnection: close\r\n" + rest


def received(connection: socket.socket) -> bytes:
    part = connection.recv(65536)
    if not part:
        raise ConnectionError("the client has gone")
    return part


def read_all(connection: socket.socket) -> bytes:
    data = b""
    while part := connection.recv(65536):
        data += part
    return data


@pytest.fixture
def peer(service: Service) -> Iterator[Peer]:
    made = Peer(service)
    yield made
    made.close()


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    running = Service(tmp_path / "data")
    yield running
    running.kill()
