"""The example examples/edge_client.py, as a process, with the real service behind a bad line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import IO

from conftest import Peer, answered, problem

import offbd

EXAMPLE = Path(__file__).parents[3] / "examples/edge_client.py"


def start(peer: Peer, session: str = "s") -> subprocess.Popen[str]:
    command = [sys.executable, str(EXAMPLE), "--url", peer.url, "--asset", "rig", "--session"]
    process = subprocess.Popen(
        [*command, session, "--rows", "10", "-"],
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    pipe_of(process).write("t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n")
    return process


def pipe_of(process: subprocess.Popen[str]) -> IO[str]:
    assert process.stdin is not None
    return process.stdin


def write(process: subprocess.Popen[str], first: int, last: int) -> None:
    pipe = pipe_of(process)
    pipe.write("".join(f"{n / 100},0,0,0.01,0.02\n" for n in range(first, last + 1)))
    pipe.flush()


def told_at_end(process: subprocess.Popen[str], status: int) -> str:
    """Ends the input; returns what the client has said by its end."""
    _, told = process.communicate()
    assert process.returncode == status, told
    return told


def recorded(client: offbd.Client) -> dict[str, list[int | None]]:
    """The numbers of the samples of each session."""
    sessions = list(client.sessions("rig"))
    return {s["name"]: [row.get("seq") for row in client.recording(s["id"])] for s in sessions}


def test_no_answer_but_the_services_own_ends_the_wait_of_a_row(peer: Peer) -> None:
    client = offbd.Client(peer.url)
    client.put_asset("rig", {})
    acknowledgement = '{"accepted": 10, "duplicate": 0, "rejected": []}'
    lies = [
        answered("200 OK", acknowledgement, cut=5),
        b"HTTP/1.1 200",
        b"nonsense\r\n\r\n",
        answered("200 OK", "<html>Log in</html>"),
        answered("200 OK", "{}"),
        answered("200 OK", acknowledgement.replace("10", "9")),
        answered("400 Bad Request", "<html>a proxy</html>"),
        problem("401 Unauthorized", "unauthenticated"),
        problem("404 Not Found", "not-found"),
    ]
    for n, lie in enumerate(lies):
        peer.answers = [lie]
        process = start(peer, f"s{n}")
        write(process, 1, 25)
        told = told_at_end(process, 0)
        assert told.count("retrying") == 1 and peer.answers == [], told
    assert recorded(client) == {f"s{n}": list(range(1, 26)) for n in range(len(lies))}


def test_after_the_end_of_its_session_the_rows_go_to_another_one(peer: Peer) -> None:
    client = offbd.Client(peer.url)
    client.put_asset("rig", {})
    process = start(peer)
    write(process, 1, 10)
    while recorded(client) != {"s": list(range(1, 11))}:
        pass
    (session,) = client.sessions("rig")
    client.end_session(session["id"])
    write(process, 11, 30)
    told = told_at_end(process, 0)
    assert "session s has ended; the next is s-2" in told
    assert recorded(client) == {"s": list(range(1, 11)), "s-2": list(range(11, 31))}


def test_a_batch_that_is_refused_for_good_is_reported_and_the_next_are_sent(peer: Peer) -> None:
    client = offbd.Client(peer.url)
    client.put_asset("rig", {})
    peer.answers = [problem("422 Unprocessable Entity", "invalid")]
    process = start(peer)
    write(process, 1, 20)
    told = told_at_end(process, 1)
    assert "seq 1 to 10 refused: 422: invalid" in told
    assert recorded(client) == {"s": list(range(11, 21))}
