"""The client, with a real service and a proxy that loses connections."""

from __future__ import annotations

import json
import random
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pytest
from conftest import Peer, Service, answered, problem, read_all, read_request

import offbd


class LossyProxy:
    """Passes connections on. Of every ten, one is closed before the request, one after it:
    then the service has stored the batch, but the client does not know."""

    def __init__(self, service: Service) -> None:
        self.service = service
        self.random = random.Random(1)
        self.n_lost = 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self.accept, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.listener.getsockname()[1]}"

    def accept(self) -> None:
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self.serve, args=(connection,), daemon=True).start()

    def serve(self, connection: socket.socket) -> None:
        fate = self.random.randrange(10)
        host, port = self.service.listen.rsplit(":", 1)
        with connection:
            if fate == 0:
                self.n_lost += 1
                return
            # A client that has given up, or a service that is just being killed.
            try:
                with socket.create_connection((host, int(port))) as upstream:
                    upstream.sendall(read_request(connection))
                    answer = read_all(upstream)
            except OSError:
                return
            if fate == 1:
                self.n_lost += 1
                return
            try:
                connection.sendall(answer)
            except OSError:
                pass


@pytest.fixture
def proxy(service: Service) -> Iterator[LossyProxy]:
    made = LossyProxy(service)
    yield made
    made.listener.close()


def test_nothing_is_lost_or_doubled_by_a_lossy_line_and_a_kill(
    service: Service, proxy: LossyProxy, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("offbd.client.MAX_BATCH_ROWS", 40)
    monkeypatch.setattr("offbd.client.FIRST_DELAY_S", 0.01)
    simulation = offbd.simulate(seed=2, faults=["x_servo:dead@20"], seconds=40, seq=True)
    samples = list(offbd.rows(simulation.table))
    client = offbd.Client(proxy.url)
    asset = {**json.loads((folder / "learnt.json").read_text()), "name": "rig"}
    client.put_asset("rig", asset)
    half = len(samples) // 2
    first = client.send("rig", samples[:half], session="s")
    service.kill()
    service.start()
    second = client.send("rig", samples[half:], session="s")
    assert proxy.n_lost > 5
    total = first.accepted + first.duplicate + second.accepted + second.duplicate
    assert total == len(samples) and first.rejected == second.rejected == []
    assert second.session_id is not None
    ended = client.end_session(second.session_id)
    assert client.recording(second.session_id) == samples
    wanted = offbd.replay(simulation.table, asset)
    assert wanted.confirmed == ["x_servo"]
    assert ended["verdict"]["verdict_hash"] == wanted.hash
    again = client.replay(second.session_id)
    assert again["result"]["summary"]["verdict_hash"] == wanted.hash
    assert [fault["code"] for fault in client.faults("rig", status="confirmed")] == wanted.confirmed
    # The proxy passes only whole answers on, and this one never ends.
    events = offbd.Client(service.url).events("rig", after=0)
    seen = [next(events).data["t_s"] for _ in wanted.faults]
    assert seen == [fault["t_s"] for fault in wanted.faults]
    assert [session["id"] for session in client.sessions("rig")] == [second.session_id]
    assert [asset["name"] for asset in client.assets()] == ["rig"]


def test_an_imported_fault_is_an_alarm_until_somebody_clears_it(
    service: Service, folder: Path
) -> None:
    client = offbd.Client(service.url)
    client.put_asset("rig", json.loads((folder / "learnt.json").read_text()))
    content = (folder / "sick.csv").read_bytes()
    imported = client.import_session("rig", content, name="monday & co")
    assert imported["session"]["name"] == "monday & co"
    assert imported["accepted"] == content.count(b"\n") - 1
    series = client.series("rig", step_s=3600, aggregate="last")
    assert (series["step_s"], series["aggregate"]) == (3600, "last")
    assert [row["faulty"] for row in series["rows"]] == [1]
    assert client.series("rig", before="2000-01-01T00:00:00Z")["rows"] == []
    assert [alarm["code"] for alarm in client.alarms("rig")] == ["x_servo"]
    client.acknowledge_fault("rig", "x_servo", "Ada & Bob")
    client.clear_fault("rig", "x_servo", "Eve")
    assert list(client.alarms("rig")) == []
    acts = [entry for entry in client.fault_history("rig", "x_servo") if entry["by"]]
    assert [(entry["what"], entry["by"]) for entry in acts] == [
        ("clear", "Eve"),
        ("acknowledge", "Ada & Bob"),
    ]


def test_a_refusal_is_an_error_with_its_problem(service: Service) -> None:
    client = offbd.Client(service.url)
    with pytest.raises(offbd.ClientError, match="404") as refusal:
        client.asset("none")
    assert refusal.value.status == 404
    assert refusal.value.problem["status"] == 404
    client.put_asset("rig", {})
    acknowledged = client.send("rig", [{"seq": 1, "t_s": 0.0}, {"seq": 2, "t_s": "x"}])
    assert acknowledged.accepted == 1
    assert [index for index, _ in acknowledged.rejected] == [1]


def test_a_service_that_cannot_be_reached_is_an_error_after_the_patience() -> None:
    with socket.create_server(("127.0.0.1", 0)) as unused:
        port = unused.getsockname()[1]
    with pytest.raises(offbd.ClientError) as failure:
        offbd.Client(f"http://127.0.0.1:{port}", patience_s=0).assets()
    assert failure.value.status is None
    with pytest.raises(ValueError, match="http://"):
        offbd.Client("127.0.0.1:8087")


HTML = "<html><h1>Log in</h1></html>"


@pytest.mark.parametrize(
    ("answer", "told", "status"),
    [
        (answered("200 OK", HTML), "200 OK, but not an answer of offbd: <html><h1>Log in", None),
        (answered("200 OK", "{}"), "200 OK, but not an answer of offbd: {}", None),
        (answered("200 OK", ""), "200 OK, but not an answer of offbd", None),
        (answered("200 OK", '{"accepted": 1}', cut=4), "IncompleteRead", None),
        (answered("501 Not Implemented", HTML), "501 Not Implemented: <html><h1>Log in", 501),
        (problem("429 Too Many Requests", "busy"), "429 Too Many Requests: busy", 429),
    ],
)
def test_what_a_peer_answers_that_has_not_stored_the_samples_is_told(
    peer: Peer, caplog: pytest.LogCaptureFixture, answer: bytes, told: str, status: int | None
) -> None:
    offbd.Client(peer.service.url).put_asset("rig", {})  # type: ignore[union-attr]
    samples = [{"seq": 1, "t_s": 0.0}]
    peer.answers = [answer]
    with pytest.raises(offbd.ClientError) as failure:
        offbd.Client(peer.url, patience_s=0.0).send("rig", samples, session="s")
    assert told in str(failure.value) and peer.url in str(failure.value)
    assert (failure.value.status, failure.value.is_final) == (status, False)
    assert caplog.records == []
    # With patience it is logged, and the samples are sent again.
    peer.answers = [answer]
    assert offbd.Client(peer.url).send("rig", samples, session="s").accepted == 1
    assert [(r.name, r.levelname, told in r.getMessage()) for r in caplog.records] == [
        ("offbd", "WARNING", True)
    ]


def test_the_patience_is_bounded_unless_the_caller_says_otherwise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as unused:
        port = unused.getsockname()[1]
    clock = [0.0]

    def sleep(seconds: float) -> None:
        clock[0] += seconds
        if clock[0] > 1000.0:
            raise TimeoutError("the client waits for ever")

    monkeypatch.setattr("offbd.client.time.sleep", sleep)
    monkeypatch.setattr("offbd.client.time.monotonic", lambda: clock[0])
    with pytest.raises(offbd.ClientError, match="refused"):
        offbd.Client(f"http://127.0.0.1:{port}").assets()
    assert 10.0 < clock[0] <= 60.0
    with pytest.raises(TimeoutError, match="for ever"):
        offbd.Client(f"http://127.0.0.1:{port}", patience_s=None).assets()


def test_only_a_refusal_of_samples_by_the_service_itself_is_final(
    service: Service, peer: Peer
) -> None:
    client = offbd.Client(peer.url)

    def refusal(asset: str = "rig", **more: str) -> offbd.ClientError:
        with pytest.raises(offbd.ClientError) as refused:
            client.send(asset, [{"seq": 1, "t_s": 0.0}], **more)
        return refused.value

    missing = refusal()
    assert (missing.status, missing.is_final) == (404, False)
    client.put_asset("rig", {})
    name = refusal(session="x" * 300)
    assert (name.status, name.is_final, name.session_ended) == (422, True, False)
    peer.answers = [answered("413 Payload Too Large", HTML)]
    proxy = refusal()
    assert (proxy.status, proxy.is_final) == (413, False)
    peer.answers = [problem("401 Unauthorized", "unauthenticated")]
    assert not refusal().is_final
    stored = client.send("rig", [{"seq": 0, "t_s": 0.0}], session="s")
    assert stored.session_id is not None
    client.end_session(stored.session_id)
    with pytest.raises(offbd.ClientError) as ended:
        client.send("rig", [{"seq": 1, "t_s": 1.0}], session="s")
    assert (ended.value.status, ended.value.is_final) == (409, True)
    assert ended.value.session_ended


def test_rows_of_a_table_are_what_is_sent(folder: Path) -> None:
    table = offbd.simulate(seconds=1, seq=True).table
    assert list(offbd.rows(table)) == pa.table(table).to_pylist()
