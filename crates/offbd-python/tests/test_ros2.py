"""The part of the ROS 2 example that needs no ROS, with a real service."""

from __future__ import annotations

import csv
import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import Service

import offbd

EXAMPLE = Path(__file__).parents[3] / "examples/ros2"


def load() -> Any:
    spec = importlib.util.spec_from_file_location("bridge", EXAMPLE / "offbd_bridge/bridge.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["bridge"] = module
    spec.loader.exec_module(module)
    return module


bridge = load()


def deliver_all(one: Any) -> None:
    while one.deliver():
        pass


def test_the_samples_arrive_and_the_dead_servo_is_an_error(service: Service, folder: Path) -> None:
    one = bridge.Bridge(offbd.Client(service.url), "rig", "s")
    assert [d.level for d in one.diagnoses()] == [bridge.STALE] * 4, "no such asset yet"
    client = offbd.Client(service.url)
    client.put_asset("rig", {})
    with open(folder / "sick.csv") as file:
        rows = [
            {key: float(value) for key, value in row.items() if value}
            for row in csv.DictReader(file)
        ]
    for row in rows:
        one.command(row["cmd_qx_rad"], row["cmd_qy_rad"])
        one.position(row["t_s"], row.get("x_m"), row.get("y_m"))
    deliver_all(one)
    (session,) = client.sessions("rig")
    recording = client.recording(session["id"])
    keys = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"]
    assert [[s[k] for k in keys] for s in recording] == [[r.get(k) for k in keys] for r in rows]
    levels = {d.name: d.level for d in one.diagnoses()}
    # Not STALE, which is a higher number: after the last sample the verdict is still known.
    assert levels["rig: x servo"] in (bridge.WARN, bridge.ERROR), levels
    assert levels["rig: y servo"] == bridge.OK, levels
    assert one.n_dropped == one.n_refused == 0


def test_samples_wait_while_the_service_is_away_and_the_oldest_is_dropped(service: Service) -> None:
    client = offbd.Client(service.url, patience_s=0.0)
    client.put_asset("rig", {})
    one = bridge.Bridge(client, "rig", "s", capacity=3)
    one.command(0.0, 0.0)
    service.kill()
    for i in range(4):
        one.position(0.01 * i, 0.0, None)
    with pytest.raises(offbd.ClientError):
        one.deliver()
    service.start()
    one.client = offbd.Client(service.url)
    deliver_all(one)
    (session,) = one.client.sessions("rig")
    assert [s["seq"] for s in one.client.recording(session["id"])] == [1, 2, 3]
    assert (one.n_dropped, one.n_refused) == (1, 0)


def test_a_refused_batch_is_counted_and_does_not_stop_the_next(service: Service) -> None:
    client = offbd.Client(service.url)
    client.put_asset("rig", {})
    one = bridge.Bridge(client, "bad/name?", "s")
    one.position(0.0, 0.0, 0.0)
    with pytest.raises(offbd.ClientError):
        one.deliver()
    assert one.n_refused == 1 and one.last_refusal
    assert one.deliver() == 0


@pytest.mark.parametrize(
    ("status", "byte", "level", "message"),
    [
        ("confirmed", "2f", "ERROR", "confirmed, dead"),
        ("confirmed", "2c", "WARN", "passes again; on record as confirmed, dead"),
        ("pending", "27", "WARN", "pending, dead"),
    ],
)
def test_only_a_confirmed_fault_that_fails_now_is_an_error(
    status: str, byte: str, level: str, message: str
) -> None:
    one = bridge.Bridge(offbd.Client(), "rig", "s")
    fault = {"code": "x_servo", "status": status, "status_byte": byte, "kind": "dead"}
    found = {d.name: d for d in one.of_faults([fault])}
    assert found["rig: x servo"].level == getattr(bridge, level)
    assert found["rig: x servo"].message == message
    assert found["rig: ball"].level == bridge.OK
