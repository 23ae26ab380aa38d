#!/usr/bin/env python3
"""Checks that the generated client has every operation and every schema of the description.

    whole.py OPENAPI.yaml GENERATOR_OUTPUT CLIENT_FOLDER PYTHON

The description is read by the generator's own Python, which has a parser of YAML.
"""

import json
import pathlib
import re
import subprocess
import sys

READ = "import json, sys; from ruamel.yaml import YAML; print(json.dumps(YAML(typ='safe').load(open(sys.argv[1])), default=str))"

# Bodies that the generator does not support. The operations have another body, so that they
# are in the client nevertheless.
FOREIGN_BODIES = {
    "Unsupported content type application/msgpack",
    "Unsupported content type application/vnd.apache.arrow.stream",
    "Unsupported content type application/vnd.apache.parquet",
    "Unsupported content type application/vnd.mcap",
    "Unsupported content type application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
    "Unsupported content type application/x-ndjson",
    "Unsupported content type text/csv",
}


def main():
    description, printed, client, python = sys.argv[1:]
    document = subprocess.run([python, "-c", READ, description], check=True, capture_output=True)
    document = json.loads(document.stdout)
    wrong = []
    modules = {path.stem for path in pathlib.Path(client, "api").glob("*/*.py")}
    operations = [
        operation["operationId"]
        for item in document["paths"].values()
        for method, operation in item.items()
        if method in ("get", "put", "post", "delete")
    ]
    wrong += [f"no operation {name}" for name in operations if name not in modules]
    models = pathlib.Path(client, "models", "__init__.py").read_text()
    models = set(re.findall(r'"(\w+)"', models))
    objects = [
        name
        for name, schema in document["components"]["schemas"].items()
        if schema.get("properties") or "enum" in schema or "allOf" in schema
    ]
    # The name of a builtin of Python gets an underscore.
    wrong += [f"no model {name}" for name in objects if not models & {name, f"{name}Model", f"{name}_"}]
    # A model without its own name was repeated inside another one.
    wrong += [f"a nameless model {name}" for name in models if name.endswith("Item")]
    output = pathlib.Path(printed).read_text()
    warnings = re.findall(r"Unsupported content type \S+|Cannot [^\n]*|Unable [^\n]*", output)
    wrong += [warning for warning in warnings if warning.rstrip(".") not in FOREIGN_BODIES]
    for line in wrong:
        print(f"python-client: {line}", file=sys.stderr)
    print(f"{len(operations)} operations, {len(models)} models")
    if wrong or len(operations) < 40 or len(models) < 80:
        print(output, file=sys.stderr)
        sys.exit(1)


main()
