#!/usr/bin/env python3
"""Walks through /sovd as a client of SOVD does, and checks every answer against the JSON schema
that it has with `include-schema=true`.

    sovd.py ADDRESS RIG

RIG has an active fault `x_servo` and a recording; $CLIENT_TOKEN is a token of an admin.
"""

import json
import os
import sys
import urllib.error
import urllib.parse
import urllib.request

import jsonschema

ADDRESS, RIG = sys.argv[1:]
HEADERS = {"Authorization": f"Bearer {os.environ['CLIENT_TOKEN']}"}
n_checked = 0


def ask(path, method="GET", **query):
    """Returns status and body of a request."""
    pairs = {key.replace("_", "-"): value for key, value in query.items()}
    url = f"{ADDRESS}{path}" + (f"?{urllib.parse.urlencode(pairs)}" if pairs else "")
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=HEADERS, method=method)) as response:
            return response.status, response.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def get(path, **query):
    """Returns an answer without its schema, which it must satisfy."""
    global n_checked
    status, text = ask(path, include_schema="true", **query)
    assert status == 200, (path, status, text)
    answer = json.loads(text)
    schema = answer.pop("schema")
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(answer)
    # The schema must be able to refuse something.
    assert not jsonschema.Draft202012Validator(schema).is_valid({}), path
    bare_status, bare = ask(path, **query)
    assert bare_status == 200 and "schema" not in json.loads(bare), path
    n_checked += 1
    return answer


def faults(expected, **query):
    codes = [item["code"] for item in get(f"{component['faults']}", **query)["items"]]
    assert codes == expected, (query, codes)


def refused(path, status, error_code, method="GET", **query):
    found, text = ask(path, method, **query)
    error = json.loads(text)
    assert (found, error["error_code"]) == (status, error_code), (path, found, text)
    assert error["message"] and error["vendor_code"] and isinstance(error["parameters"], dict)
    return error


base = get("/sovd/version-info")["sovd_info"][0]["base_uri"]
components = get(f"{base}/components")["items"]
reference = next(item for item in components if item["id"] == RIG)
component = get(reference["href"])
assert component["id"] == RIG

items = get(component["faults"])["items"]
fault = next(item for item in items if item["code"] == "x_servo")
status = fault["status"]
assert status["confirmedDTC"] == "1" and status["aggregatedStatus"] == "active", status
bits = ["testFailed", "testFailedThisOperationCycle", "pendingDTC", "confirmedDTC"]
bits += ["testNotCompletedSinceLastClear", "testFailedSinceLastClear"]
bits += ["testNotCompletedThisOperationCycle", "warningIndicatorRequested"]
mask = sum(int(status[bit]) << i for i, bit in enumerate(bits))
assert int(status["mask"], 16) == mask, status

confirmed = [item["code"] for item in items if item["status"]["confirmedDTC"] == "1"]
everything = [item["code"] for item in items]
for spelling in ("confirmedDTC", "confirmedDtc", "CONFIRMEDDTC"):
    for word in ("1", "true"):
        faults(confirmed, **{f"status[{spelling}]": word})
# Alternatives; with a status, faults that were cleared are listed too.
codes = ["sensor", "stuck_ball", "x_servo", "y_servo"]
faults(codes, **{"status[confirmedDTC]": "1", "status[confirmedDtc]": "0"})
faults(confirmed, **{"status[mask]": "08"})
faults(everything, scope="rig")
faults([], scope="other")
faults(confirmed, severity="2")

detail = get(f"{component['faults']}/x_servo")
assert detail["item"] == fault
environment = detail["environment_data"]
assert environment["extended_data_records"]["data"]["occurrence_counter"] >= 1
snapshots = environment["snapshots"]
assert [snapshot["type"] for snapshot in snapshots] == ["freeze_frame", "recording"]
assert detail["x-offbd"]["code"] == "x_servo"
bare = get(f"{component['faults']}/x_servo", include_snapshot_data="false")["environment_data"]
assert "snapshots" not in bare and "extended_data_records" in bare
none = {"include_snapshot_data": "false", "include_extended_data": "false"}
assert "environment_data" not in get(f"{component['faults']}/x_servo", **none)

for value in get(component["data"])["items"]:
    assert get(value["href"])["id"] == value["id"]

[category] = get(component["bulk-data"])["items"]
recordings = get(category["href"])["items"]
_, csv = ask(recordings[0]["href"])
assert snapshots[1]["bulk_data_uri"] == recordings[0]["href"], snapshots[1]
assert csv.startswith("t_s,") or csv.startswith("seq,"), csv[:40]
assert len(csv.splitlines()) == recordings[0]["x-offbd"]["samples"] + 1

refused(f"{base}/components/nobody", 404, "vendor-specific")
refused(f"{component['faults']}/z_servo", 404, "vendor-specific")
refused(f"{component['data']}/weight", 404, "vendor-specific")
refused(f"{category['href']}/none", 404, "vendor-specific")
refused(f"{base}/nothing", 404, "vendor-specific")
wrong = refused(component["faults"], 400, "incomplete-request", colour="red")
assert wrong["parameters"] == {"parameter": "colour"}, wrong
refused(component["faults"], 400, "incomplete-request", **{"status[colour]": "1"})
refused(component["faults"], 400, "incomplete-request", severity="9")

assert ask(f"{component['faults']}/x_servo", "DELETE") == (204, "")
faults([code for code in everything if code != "x_servo"])
assert ask(component["faults"], "DELETE") == (204, "")
faults([])
assert get(f"{component['faults']}/x_servo")["item"]["status"]["aggregatedStatus"] == "cleared"
print(f"{n_checked} answers fit their schemas")
