"""The Python blocks of the pages about the package run as they are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import Service

ROOT = Path(__file__).parents[3]


def blocks(page: str) -> list[str]:
    """Returns the Python blocks of a page, from the root of the project."""
    return re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(), re.M | re.S)


def run(page: str, url: str) -> None:
    """Runs the blocks of a page one after the other, with the service at `url`."""
    found = blocks(page)
    assert found, page
    names: dict[str, object] = {}
    for i, block in enumerate(found):
        code = block.replace("http://127.0.0.1:8087", url)
        exec(compile(code, f"{page}, block {i + 1}", "exec"), names)


def test_the_page_about_python_and_rust(capsys: pytest.CaptureFixture[str]) -> None:
    run("docs/library.md", "")
    assert capsys.readouterr().out == "['x_servo']\n", "as the comment in the block says"


def test_the_page_of_the_package(service: Service, capsys: pytest.CaptureFixture[str]) -> None:
    run("crates/offbd-python/README.md", service.url)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("['x_servo'] ")
    # The service judges as the package does.
    assert lines[1] == lines[0].split()[-1]
    assert lines[2] == "['x_servo']"
