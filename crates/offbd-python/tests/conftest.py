"""Fixtures: the program `offbd` of the same build, recordings that it makes, and a service."""

from __future__ import annotations

import json
import os
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
    """A folder with rig.json, healthy.csv, learnt.json and sick.csv, all made by `offbd`."""
    made = tmp_path_factory.mktemp("recordings")
    healthy, sick, rig = made / "healthy.csv", made / "sick.csv", made / "rig.json"
    simulate = ("simulate", "--reference", "lissajous", "--seconds", "60")
    run_program(*simulate, "--rig", rig, "-o", healthy)
    run_program("simulate", "--seed", "2", "--fault", "x_servo:dead@20", "-o", sick)
    run_program("calibrate", "--asset", rig, healthy, "-o", made / "learnt.json")
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


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    running = Service(tmp_path / "data")
    yield running
    running.kill()
