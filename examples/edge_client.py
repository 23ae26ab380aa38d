#!/usr/bin/env python3
"""Sends telemetry of a rig to offbd, from a CSV file or from a device's output.

    edge_client.py --asset my-rig session.csv
    my_logger | edge_client.py --asset my-rig --register rig.json -

Uses only Python's standard library. Rows are numbered and sent in batches. A batch
is retried with growing delays until the service acknowledges that it is stored; a
sample that arrives twice is stored once. So no row is lost or duplicated, whatever
happens to the connection. A batch that the service refuses for good is reported, and
the exit status is 1. If the session has ended, the next rows go to another one,
SESSION-2 and so on. The rows are CSV with the header
t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m (and `seq`, if the device numbers its rows).
"""

import argparse
import csv
import http.client
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
MAX_DELAY_S = 5.0
MAX_RETRY_AFTER_S = 30.0
TIMEOUT_S = 30.0
HEADERS = {"Content-Type": "application/json"}
# With these the service refuses a batch for good. Everything else may pass, also an asset or a
# token that is missing, and what a proxy answers.
FINAL = (400, 409, 413, 415, 422)
PROBLEM_TYPE = "urn:offbd:problem:"


class Refused(Exception):
    """The service has refused a request for good."""

    def __init__(self, status, problem):
        super().__init__(f"{status}: {problem.get('detail') or problem.get('title')}")
        self.session_ended = problem["type"] == PROBLEM_TYPE + "session-ended"


def main():
    args = parse_arguments()
    if args.token_file:
        with open(args.token_file) as file:
            HEADERS["Authorization"] = f"Bearer {file.read().strip()}"
    base = f"{args.url}/api/v1/assets/{urllib.parse.quote(args.asset)}"
    if args.register:
        with open(args.register, "rb") as file:
            register(base, file.read())
    rows = queue.Queue()
    source = sys.stdin if args.file == "-" else open(args.file, newline="")
    threading.Thread(target=read, args=(source, rows), daemon=True).start()
    sent = accepted = 0
    name = args.session or time.strftime("edge-%Y%m%dT%H%M%S", time.gmtime())
    session, number = name, 1
    for batch in batches(rows, args.rows, args.seconds):
        sent += len(batch)
        ack = None
        while ack is None:
            try:
                ack = send(base, session, batch)
            except Refused as refused:
                if not refused.session_ended:
                    say(f"seq {batch[0]['seq']} to {batch[-1]['seq']} refused: {refused}")
                    break
                number += 1
                say(f"session {session} has ended; the next is {name}-{number}")
                session = f"{name}-{number}"
        if ack is not None:
            accepted += ack["accepted"] + ack["duplicate"]
            for row in ack["rejected"]:
                say(f"seq {batch[row['index']]['seq']} rejected: {row['reason']}")
    say(f"session {session}: {sent} rows sent, {accepted} stored")
    return 0 if accepted == sent else 1


def register(base, asset):
    try:
        deliver("PUT", base, asset, lambda answer: "name" in answer)
    except Refused as refused:
        sys.exit(f"edge_client: {refused}")


def send(base, session, batch):
    """Sends a batch until the service has acknowledged all of it; returns the acknowledgement."""

    def acknowledges(answer):
        return answer["accepted"] + answer["duplicate"] + len(answer["rejected"]) == len(batch)

    body = json.dumps({"session": session, "samples": batch}).encode()
    return deliver("POST", base + "/telemetry", body, acknowledges)


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


def deliver(method, url, body, is_expected):
    """Sends a request until the service answers as expected; returns the answer."""
    delay = 0.2
    while True:
        request = urllib.request.Request(url, data=body, method=method, headers=HEADERS)
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT_S) as response:
                answer = json.load(response)
                if is_expected(answer):
                    return answer
                reason = f"{response.status}, but not an answer of offbd"
        except urllib.error.HTTPError as error:
            problem = problem_of(error)
            if error.code in FINAL and problem:
                raise Refused(error.code, problem) from None
            reason = f"{error.code} {error.reason}"
            delay = max(delay, retry_after(error))
        except (OSError, http.client.HTTPException) as error:
            reason = str(error) or type(error).__name__
        except (ValueError, TypeError, KeyError):
            reason = "an answer that is not of offbd"
        say(f"{reason}; retrying in {delay:.1f} s")
        time.sleep(delay * random.uniform(0.8, 1.2))
        delay = min(2 * delay, MAX_DELAY_S)


def problem_of(error):
    """Returns the problem of an answer of the service; None if it is of something else."""
    try:
        problem = json.load(error)
        return problem if problem["type"].startswith(PROBLEM_TYPE) else None
    except (OSError, http.client.HTTPException, ValueError, TypeError, KeyError, AttributeError):
        return None


def retry_after(error):
    """Returns the delay that the service requests, in seconds."""
    try:
        return min(max(float(error.headers.get("Retry-After", 0)), 0.0), MAX_RETRY_AFTER_S)
    except ValueError:
        return 0.0


def say(text):
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
