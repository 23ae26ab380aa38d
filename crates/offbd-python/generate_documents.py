"""Writes python/offbd/documents.py: the types of the documents that the package returns, from
openapi.yaml.

    generate_documents.py            write
    generate_documents.py --check    fail if the file is not what would be written
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import yaml

HERE = Path(__file__).parent
OPENAPI = HERE / "../../openapi.yaml"
DOCUMENTS = HERE / "python/offbd/documents.py"
ROOTS = (
    "Alarm",
    "Asset",
    "CalibrationJob",
    "Fault",
    "FaultEntry",
    "FaultEvent",
    "Fleet",
    "History",
    "Import",
    "Learning",
    "PlantModel",
    "Replay",
    "ReplaySettings",
    "Sample",
    "Series",
    "Session",
    "State",
    "Summary",
)
"""The schemas of what the package takes and returns; those that they name come with them."""
HEAD = '''"""The documents of offbd, as in openapi.yaml. generate_documents.py writes this file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict

if TYPE_CHECKING:
    # Python 3.10 has it in no module of its library, and needs it only to check types.
    from typing_extensions import NotRequired
'''


def named(value: Any) -> set[str]:
    """Returns the names of the schemas to which `value` refers."""
    if isinstance(value, list):
        return set[str]().union(*map(named, value))
    if not isinstance(value, dict):
        return set()
    prefix = "#/components/schemas/"
    own = {text.removeprefix(prefix) for key, text in value.items() if key == "$ref"}
    return own.union(*map(named, value.values()))


def needed(schemas: dict[str, Any]) -> dict[str, Any]:
    """Returns the schemas of `ROOTS`, and all to which these refer."""
    found: set[str] = set()
    to_do = set(ROOTS)
    while to_do:
        found |= to_do
        to_do = set[str]().union(*(named(schemas[name]) for name in to_do)) - found
    return {name: plain(schema) for name, schema in schemas.items() if name in found}


def plain(schema: dict[str, Any]) -> dict[str, Any]:
    """Returns `schema` without the fields that no class can have, such as `$schema`."""
    if "properties" not in schema:
        return schema
    properties = schema["properties"].items()
    return schema | {"properties": {k: v for k, v in properties if k.isidentifier()}}


def generated() -> str:
    document = yaml.safe_load(OPENAPI.read_text())
    document["paths"] = {}
    document["components"] = {"schemas": needed(document["components"]["schemas"])}
    with tempfile.TemporaryDirectory() as folder:
        reduced, types = Path(folder) / "openapi.yaml", Path(folder) / "types.py"
        reduced.write_text(yaml.safe_dump(document))
        options = [
            "--input-file-type=openapi",
            "--output-model-type=typing.TypedDict",
            "--target-python-version=3.10",
            "--enum-field-as-literal=all",
            "--use-schema-description",
            "--use-field-description",
            "--use-union-operator",
            "--no-use-closed-typed-dict",
            "--disable-timestamp",
            "--formatters=builtin",
        ]
        command = [sys.executable, "-m", "datamodel_code_generator", *options]
        subprocess.run([*command, "--input", reduced, "--output", types], check=True)
        _, _, classes = types.read_text().partition("from typing_extensions import ")
        _, _, classes = classes.partition("\n")
        return formatted(HEAD + classes)


def formatted(text: str) -> str:
    command = [sys.executable, "-m", "ruff", "format", "--stdin-filename", str(DOCUMENTS), "-"]
    done = subprocess.run(command, input=text, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout


def main() -> None:
    text = generated()
    if sys.argv[1:] != ["--check"]:
        DOCUMENTS.write_text(text)
    elif DOCUMENTS.read_text() != text:
        sys.exit(f"{DOCUMENTS.name} does not agree with openapi.yaml: run {Path(__file__).name}")


if __name__ == "__main__":
    main()
