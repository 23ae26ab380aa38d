#!/usr/bin/env python3
"""Sends telemetry of a rig to offbd, from a CSV file or from a device's output.

    edge_client.py --asset my-rig session.csv
    my_logger | edge_client.py --asset my-rig --register rig.json -

Uses only Python's standard library. Rows are numbered and sent in batches. A batch
is retried with growing delays until the service acknowledges that it is stored; a
sample that arrives twice is stored once. So no row is lost or duplicated, whatever
happens to the connection. The rows are CSV with the header
t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m (and `seq`, if the device numbers its rows).
"""

import argparse
import csv
import json
import queue
import random
import sys
import threading
import time
import urllib.error
import urllib.parse
import urllib.request

COLUMNS = ("t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m")
MAX_DELAY_S = 30.0
TIMEOUT_S = 30.0
HEADERS = {"Content-Type": "application/json"}


def main():
    args = parse_arguments()
    if args.token_file:
        with open(args.token_file) as file:
            HEADERS["Authorization"] = f"Bearer {file.read().strip()}"
    base = f"{args.url}/api/v1/assets/{urllib.parse.quote(args.asset)}"
    if args.register:
        with open(args.register, "rb") as file:
            deliver("PUT", base, file.read())
    session = args.session or time.strftime("edge-%Y%m%dT%H%M%S", time.gmtime())
    rows = queue.Queue()
    source = sys.stdin if args.file == "-" else open(args.file, newline="")
    threading.Thread(target=read, args=(source, rows), daemon=True).start()
    sent = accepted = 0
    for batch in batches(rows, args.rows, args.seconds):
        body = json.dumps({"session": session, "samples": batch}).encode()
        ack = deliver("POST", base + "/telemetry", body)
        sent += len(batch)
        accepted += ack["accepted"] + ack["duplicate"]
        for row in ack["rejected"]:
            say(f"seq {batch[row['index']]['seq']} rejected: {row['reason']}")
    say(f"session {session}: {sent} rows sent, {accepted} stored")
    return 0 if accepted == sent else 1


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("file", help="CSV file, or - for stdin")
    parser.add_argument("--asset", required=True, help="name of the asset at the service")
    parser.add_argument("--url", default="http://127.0.0.1:8087")
    parser.add_argument("--token-file", metavar="FILE", help="file with the device's token")
    parser.add_argument("--session", help="name of the session [default: from the time]")
    parser.add_argument("--register", metavar="ASSET.json", help="register this asset file first")
    parser.add_argument("--rows", type=int, default=100, help="largest number of rows per batch")
    parser.add_argument("--seconds", type=float, default=0.5, help="longest time that a row waits for its batch")
    return parser.parse_args()


def read(source, rows):
    """Puts every row of the source into the queue, and None at the end."""
    for number, row in enumerate(csv.DictReader(source), start=1):
        sample = {name: to_number(row.get(name)) for name in COLUMNS}
        sample["seq"] = int(row.get("seq") or number)
        rows.put(sample)
    rows.put(None)


def to_number(field):
    """Converts a field: an empty one is a missing value; the service rejects invalid ones."""
    if field is None or not field.strip():
        return None
    try:
        return float(field)
    except ValueError:
        return field


def batches(rows, max_rows, max_wait_s):
    """Yields batches of at most `max_rows` rows; no row waits longer than `max_wait_s`."""
    batch, due = [], 0.0
    while True:
        try:
            wait = max(0.0, due - time.monotonic()) if batch else None
            row = rows.get(timeout=wait)
        except queue.Empty:
            yield batch
            batch = []
            continue
        if row is None:
            break
        if not batch:
            due = time.monotonic() + max_wait_s
        batch.append(row)
        if len(batch) >= max_rows:
            yield batch
            batch = []
    if batch:
        yield batch


def deliver(method, url, body):
    """Sends a request until it succeeds; returns the response."""
    delay = 0.2
    while True:
        request = urllib.request.Request(url, data=body, method=method, headers=HEADERS)
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT_S) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            if error.code not in (408, 425, 429) and error.code < 500:
                sys.exit(f"edge_client: {error.code}: {error.read().decode(errors='replace')}")
            reason = f"{error.code} {error.reason}"
            delay = max(delay, retry_after(error))
        except (OSError, ValueError) as error:
            reason = str(error)
        say(f"{reason}; retrying in {delay:.1f} s")
        time.sleep(delay * random.uniform(0.8, 1.2))
        delay = min(2 * delay, MAX_DELAY_S)


def retry_after(error):
    """Returns the delay that the service requests, in seconds."""
    try:
        return float(error.headers.get("Retry-After", 0))
    except ValueError:
        return 0.0


def say(text):
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
