"""The ROS 2 example: the part that needs no ROS, with a real service, and the node, with stubs."""

from __future__ import annotations

import csv
import importlib
import importlib.util
import math
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import pytest
from conftest import Peer, Service, answered, problem

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
    one.refresh()
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
    assert [[s.get(k) for k in keys] for s in recording] == [[r.get(k) for k in keys] for r in rows]
    one.refresh()
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


def test_a_batch_that_is_refused_for_good_is_counted_and_does_not_stop_the_next(
    service: Service,
) -> None:
    client = offbd.Client(service.url)
    client.put_asset("rig", {})
    one = bridge.Bridge(client, "rig", "x" * 300)
    one.position(0.0, 0.0, 0.0)
    with pytest.raises(offbd.ClientError):
        one.deliver()
    assert one.n_refused == 1 and "422" in one.last_refusal
    assert one.deliver() == 0


@pytest.mark.parametrize(
    "answer",
    [
        problem("401 Unauthorized", "unauthenticated"),
        problem("403 Forbidden", "forbidden"),
        problem("404 Not Found", "not-found"),
        problem("429 Too Many Requests", "busy"),
        answered("413 Payload Too Large", "<html>a proxy</html>"),
        answered("200 OK", "<html>Log in</html>"),
    ],
)
def test_samples_wait_after_an_answer_that_may_change(peer: Peer, answer: bytes) -> None:
    client = offbd.Client(peer.url, patience_s=0.0)
    client.put_asset("rig", {})
    one = bridge.Bridge(client, "rig", "s")
    for i in range(3):
        one.position(0.01 * i, 0.0, 0.0)
    peer.answers = [answer]
    with pytest.raises(offbd.ClientError):
        one.deliver()
    assert (one.deliver(), one.n_refused) == (3, 0)


def test_after_the_end_of_its_session_the_samples_go_to_another_one(peer: Peer) -> None:
    client = offbd.Client(peer.url, patience_s=0.0)
    client.put_asset("rig", {})
    one = bridge.Bridge(client, "rig", "s")
    one.position(0.0, 0.0, 0.0)
    deliver_all(one)
    # This one is stored, but its acknowledgement is lost.
    one.position(1.0, 0.0, 0.0)
    peer.answers = [b""]
    with pytest.raises(offbd.ClientError):
        one.deliver()
    assert client.send("rig", one._batch(), session="s").accepted == 1
    (session,) = client.sessions("rig")
    client.end_session(session["id"])
    one.position(2.0, 0.0, 0.0)
    assert one.deliver() == 1, "the same as before, which is a duplicate"
    with pytest.raises(offbd.ClientError, match="ended"):
        one.deliver()
    deliver_all(one)
    recorded = {s["name"]: client.recording(s["id"]) for s in client.sessions("rig")}
    assert {name: [s.get("seq") for s in rows] for name, rows in recorded.items()} == {
        "s": [0, 1],
        "s-2": [2],
    }
    assert (one.n_refused, one.session) == (0, "s-2")


def test_a_network_that_swallows_packets_does_not_hold_up_the_executor(peer: Peer) -> None:
    client = offbd.Client(peer.url, patience_s=0.0)
    client.put_asset("rig", {})
    one = bridge.Bridge(client, "rig", "s")
    one.refresh()
    assert [d.level for d in one.diagnoses()] == [bridge.OK] * 4
    peer.answers = [None]
    asking = threading.Thread(target=one.refresh, daemon=True)
    asking.start()
    while not peer.silent:
        time.sleep(0.001)
    assert len(one.diagnoses()) == 4
    assert asking.is_alive(), "it still waits for an answer"
    peer.silent[0].shutdown(socket.SHUT_RDWR)
    asking.join()
    one._known = (one._known[0] - bridge.FRESH_S, one._known[1])
    assert [d.level for d in one.diagnoses()] == [bridge.STALE] * 4


@pytest.mark.parametrize(
    ("status", "byte", "level", "message"),
    [
        ("confirmed", "2f", "ERROR", "confirmed, dead"),
        ("confirmed", "2c", "WARN", "passing again; was confirmed, dead"),
        ("pending", "27", "WARN", "suspected, dead"),
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


def test_a_kind_that_is_only_probable_is_not_told_as_a_fact() -> None:
    one = bridge.Bridge(offbd.Client(), "rig", "s")
    fault = {"code": "x_servo", "status": "confirmed", "status_byte": "2f", "kind": "dead"}
    for weight, words in [(0.512, "probably dead, 51 %"), (0.8, "dead")]:
        candidates = [{"code": "x_servo", "kind": "dead", "weight": weight}]
        found = {d.name: d for d in one.of_faults([{**fault, "candidates": candidates}])}
        assert found["rig: x servo"].message == f"confirmed, {words}"
    assert found["rig: ball"].level == bridge.OK


class RosNode:
    """Stands for `rclpy.node.Node`, with a publisher that keeps what it gets."""

    parameters: ClassVar[dict[str, str]] = {}

    def __init__(self, name: str) -> None:
        self.published: list[Any] = []

    def declare_parameter(self, name: str, default: str) -> Any:
        return SimpleNamespace(value=self.parameters.get(name, default))

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=0, to_msg=lambda: None))

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda *_, **__: None)

    def create_publisher(self, kind: Any, topic: str, depth: int) -> Any:
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, *arguments: Any) -> None:
        pass

    create_timer = create_subscription


@pytest.fixture
def silent_peer() -> Iterator[Peer]:
    """Takes each request, and answers none."""
    made = Peer()
    made.answers = [None] * 100
    yield made
    made.close()


@pytest.fixture
def ros_node(silent_peer: Peer, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The node of `node.py`, with stubs for the packages of ROS."""
    ended = threading.Event()

    def array() -> Any:
        return SimpleNamespace(header=SimpleNamespace(stamp=None), status=[])

    packages: dict[str, dict[str, Any]] = {
        "rclpy": {"ok": lambda: not ended.is_set()},
        "rclpy.node": {"Node": RosNode},
        "rclpy.qos": {"qos_profile_sensor_data": None},
        "diagnostic_msgs": {},
        "diagnostic_msgs.msg": {
            "DiagnosticArray": array,
            "DiagnosticStatus": SimpleNamespace,
            "KeyValue": SimpleNamespace,
        },
        "geometry_msgs": {},
        "geometry_msgs.msg": {"PointStamped": None},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"JointState": None},
    }
    for name, content in packages.items():
        stub = ModuleType(name)
        vars(stub).update(content)
        monkeypatch.setitem(sys.modules, name, stub)
    monkeypatch.syspath_prepend(EXAMPLE)
    monkeypatch.setattr(RosNode, "parameters", {"url": silent_peer.url})
    module = importlib.import_module("offbd_bridge.node")
    # Its threads do not try again when the peer ends.
    monkeypatch.setattr(module, "PATIENCE_S", 0.0)
    yield module.OffbdNode()
    ended.set()
    for name in ("offbd_bridge.node", "offbd_bridge.bridge", "offbd_bridge"):
        sys.modules.pop(name, None)


def test_no_callback_of_the_node_waits_for_the_service(silent_peer: Peer, ros_node: Any) -> None:
    while not silent_peer.silent:
        time.sleep(0.001)
    ros_node.on_command(SimpleNamespace(name=["qx", "qy"], position=[0.1, 0.2]))
    stamp = SimpleNamespace(sec=1, nanosec=500_000_000)
    point = SimpleNamespace(x=0.01, y=math.nan)
    ros_node.on_ball(SimpleNamespace(header=SimpleNamespace(stamp=stamp), point=point))
    ros_node.publish()
    # The first question about the faults still has no answer, not even that there is none.
    shown = [(status.level, status.message) for status in ros_node.published[0].status]
    assert shown == [(bytes([bridge.STALE]), "not asked yet")] * 4
    while len(silent_peer.silent) < 2:
        time.sleep(0.001)
    (sample,) = ros_node.bridge._batch()
    assert sample == {
        "seq": 0,
        "t_s": 1.5,
        "x_m": 0.01,
        "y_m": None,
        "cmd_qx_rad": 0.1,
        "cmd_qy_rad": 0.2,
    }
