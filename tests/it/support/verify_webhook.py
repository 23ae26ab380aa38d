"""Verifies a signed message with the reference implementation of Standard Webhooks: reads
`secret`, `headers` and `body` as JSON from the standard input."""

import json
import sys

from standardwebhooks.webhooks import Webhook

given = json.load(sys.stdin)
Webhook(given["secret"]).verify(given["body"], given["headers"])
