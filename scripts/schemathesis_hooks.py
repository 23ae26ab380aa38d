"""Lets schemathesis send telemetry as NDJSON, which it would leave out: it is a text."""

import schemathesis

schemathesis.serializer.alias("application/x-ndjson", "text/plain")
