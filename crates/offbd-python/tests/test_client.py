"""The client, with a real service and a proxy that loses connections."""

from __future__ import annotations

import json
import random
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pyarrow as pa
import pytest
from conftest import Listener, Peer, Service, answered, as_last, problem, read_all, read_request

import offbd


class LossyProxy(Listener):
    """Passes connections on. Of every ten, one is closed before the request, one after it:
    then the service has stored the batch, but the client does not know."""

    def __init__(self, service: Service) -> None:
        self.service = service
        self.random = random.Random(1)
        self.n_lost = 0
        super().__init__()

    def serve(self, connection: socket.socket) -> None:
        threading.Thread(target=self.pass_on, args=(connection,), daemon=True).start()

    def pass_on(self, connection: socket.socket) -> None:
        fate = self.random.randrange(10)
        host, port = self.service.listen.rsplit(":", 1)
        with connection:
            if fate == 0:
                self.n_lost += 1
                return
            # A client that has given up, or a service that is just being killed.
            try:
                with socket.create_connection((host, int(port))) as upstream:
                    upstream.sendall(as_last(read_request(connection)))
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


class Relay(Listener):
    """Passes connections on as they are, counts them, and notes who ends them."""

    def __init__(self, service: Service) -> None:
        self.service = service
        self.n_connections = 0
        self.ended: list[str] = []
        self.open: list[socket.socket] = []
        self.threads: list[threading.Thread] = []
        super().__init__()

    def __enter__(self) -> Relay:
        return self

    def __exit__(self, *_: object) -> None:
        self.listener.close()
        self.cut()

    def serve(self, connection: socket.socket) -> None:
        self.n_connections += 1
        host, port = self.service.listen.rsplit(":", 1)
        upstream = socket.create_connection((host, int(port)))
        self.open += [connection, upstream]
        for ends in (("client", connection, upstream), ("service", upstream, connection)):
            self.threads.append(threading.Thread(target=self.copy, args=ends))
            self.threads[-1].start()

    def copy(self, name: str, source: socket.socket, to: socket.socket) -> None:
        try:
            while part := source.recv(65536):
                to.sendall(part)
            self.ended.append(name)
            to.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # cut, or closed by the other end

    def cut(self) -> None:
        """Ends the connections that are open."""
        for end in self.open:
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass  # closed by its peer
        self.wait_for_end()

    def wait_for_end(self) -> None:
        """Returns when both ends of each connection have closed it."""
        for thread in self.threads:
            thread.join()
        for end in self.open:
            end.close()
        self.threads, self.open = [], []


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
    asset = {**json.loads((folder / "calibrated.json").read_text()), "name": "rig"}
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
    assert ended.get("verdict") == {**wanted.summary, "session": "s"}
    again = client.replay(second.session_id)
    result = again.get("result")
    assert result is not None and result["summary"]["verdict_hash"] == wanted.hash
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
    client.put_asset("rig", json.loads((folder / "calibrated.json").read_text()))
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


def send_one(url: str, patience_s: float | None = 60.0) -> offbd.Acknowledgement:
    with offbd.Client(url, patience_s=patience_s) as client:
        return client.send("rig", [{"seq": 1, "t_s": 0.0}], session="s")


@pytest.mark.parametrize(
    ("answer", "told", "status"),
    [
        (answered("200 OK", '{"accepted": 1}', cut=4), "IncompleteRead", None),
        (b"", "Remote end closed", None),
        (answered("503 Service Unavailable", HTML), "503 Service Unavailable: <html>", 503),
        (problem("429 Too Many Requests", "busy"), "429 Too Many Requests: busy", 429),
    ],
)
def test_a_failure_that_may_pass_is_logged_and_the_samples_are_sent_again(
    peer: Peer, caplog: pytest.LogCaptureFixture, answer: bytes, told: str, status: int | None
) -> None:
    offbd.Client(peer.url).put_asset("rig", {})
    peer.answers = [answer]
    with pytest.raises(offbd.ClientError) as failure:
        send_one(peer.url, patience_s=0.0)
    assert told in str(failure.value) and peer.url in str(failure.value)
    assert (failure.value.status, failure.value.is_final) == (status, False)
    assert caplog.records == []
    peer.answers = [answer]
    assert send_one(peer.url).accepted == 1
    assert [(r.name, r.levelname, told in r.getMessage()) for r in caplog.records] == [
        ("offbd", "WARNING", True)
    ]


@pytest.mark.parametrize(
    ("answer", "told", "status"),
    [
        (answered("200 OK", HTML), "200 OK, but not an answer of offbd: <html><h1>Log in", 200),
        (answered("200 OK", "{}"), "200 OK, but not an answer of offbd: {}", 200),
        (answered("200 OK", ""), "200 OK, but not an answer of offbd", 200),
        (answered("501 Not Implemented", HTML), "501 Not Implemented: <html><h1>Log in", 501),
        (answered("505 HTTP Version Not Supported", HTML), "505 HTTP Version Not", 505),
        (answered("302 Found", HTML), "302 Found: <html>", 302),
        (b"nonsense\r\n\r\n", "nonsense", None),
    ],
)
def test_an_answer_that_would_come_again_ends_the_attempts(
    peer: Peer, caplog: pytest.LogCaptureFixture, answer: bytes, told: str, status: int | None
) -> None:
    offbd.Client(peer.url).put_asset("rig", {})
    peer.answers = [answer]
    with pytest.raises(offbd.ClientError) as failure:
        send_one(peer.url, patience_s=None)
    assert told in str(failure.value) and peer.url in str(failure.value)
    assert (failure.value.status, failure.value.is_final) == (status, False)
    assert caplog.records == []


def test_requests_share_a_connection_until_the_client_is_closed(
    service: Service, caplog: pytest.LogCaptureFixture
) -> None:
    """A peer that passes everything on, byte by byte, counts the connections."""
    with Relay(service) as relay:
        with offbd.Client(relay.url) as client:
            client.put_asset("rig", {})
            for _ in range(5):
                client.send("rig", [{"seq": 1, "t_s": 0.0}])
            with pytest.raises(offbd.ClientError, match="404"):
                client.asset("none")
            assert client.state("rig")["asset"] == "rig"
            assert relay.n_connections == 1
            # The service, or a proxy, closes a connection that has been idle.
            relay.cut()
            assert len(client.assets()) == 1
            assert relay.n_connections == 2 and caplog.records == []
            relay.ended.clear()
        relay.wait_for_end()
        assert relay.ended[0] == "client"
        assert len(client.assets()) == 1, "a closed client opens a connection again"
        assert relay.n_connections == 3
        client.close()


def test_threads_may_share_a_client(service: Service) -> None:
    with offbd.Client(service.url) as client:
        client.put_asset("rig", {})
        seqs = range(200)

        def send(seq: int) -> int:
            return client.send("rig", [{"seq": seq, "t_s": seq / 100}], session="s").accepted

        with ThreadPoolExecutor(4) as pool:
            assert sum(pool.map(send, seqs)) == len(seqs)
        (session,) = client.sessions("rig")
        assert sorted(s.get("seq", -1) or 0 for s in client.recording(session["id"])) == list(seqs)


def test_a_proxy_of_the_environment_is_used(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        monkeypatch.setenv("http_proxy", f"http://a:b%40@127.0.0.1:{listener.getsockname()[1]}")
        client = offbd.Client("http://offbd.example:81", patience_s=0.0)
        asking = threading.Thread(target=lambda: client.assets())
        asking.start()
        connection, _ = listener.accept()
        with connection:
            head, _, _ = read_request(connection).partition(b"\r\n\r\n")
            page = answered("200 OK", '{"items": []}', "application/json")
            connection.sendall(page)
        asking.join()
        client.close()
    lines = head.split(b"\r\n")
    assert lines[0] == b"GET http://offbd.example:81/api/v1/assets HTTP/1.1"
    assert b"Host: offbd.example:81" in lines
    assert b"Proxy-Authorization: Basic YTpiQA==" in lines
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with offbd.Client(service.url) as direct:
        assert direct.assets() == []


def test_a_rig_is_calibrated_from_its_sessions(service: Service, folder: Path) -> None:
    with offbd.Client(service.url) as client:
        client.put_asset("rig", json.loads((folder / "rig.json").read_text()))
        imported = client.import_session("rig", (folder / "healthy.csv").read_bytes())
        job = client.calibrate("rig", [imported["session"]["id"]], "Ada")
        wanted = json.loads((folder / "calibrated.json").read_text())["calibration"]
        learnt = job.get("calibration")
        assert learnt is not None and learnt["x"] == wanted["x"]
        assert not job["active"]
        assert client.activate_calibration("rig", job["id"], "Ada")["active"]
        assert client.learning("rig")["state"]
        with pytest.raises(offbd.ClientError, match="409"):
            client.accept_learning("rig", "Ada")
        ended = client.send("rig", [{"seq": 1, "t_s": 0.0}], session="s").session_id
        assert ended is not None
        with pytest.raises(offbd.ClientError, match="failed: .*"):
            client.calibrate("rig", [client.end_session(ended)["id"]])


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
