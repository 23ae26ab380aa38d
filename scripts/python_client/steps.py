"""Takes the steps of docs/tour.md with the generated client, and checks what comes back.

    steps.py ADDRESS LEARNT.json SICK.csv

$CLIENT_TOKEN is a token of an admin.

mypy checks this file too: the types of the client are those that a user's editor knows.
"""

import json
import os
import sys
import time
from typing import Any, TypeVar

from offbd_client import AuthenticatedClient
from offbd_client.api.assets import create_asset, get_fleet, get_series, get_state, get_trends
from offbd_client.api.faults import (
    acknowledge_fault,
    clear_fault,
    get_fault,
    list_annotations,
    list_asset_faults,
    list_faults,
)
from offbd_client.api.sessions import (
    end_session,
    get_replay,
    get_session,
    get_session_telemetry,
    get_trace,
    import_session,
    list_session_faults,
    list_sessions,
    replay_session,
)
from offbd_client.api.telemetry import post_telemetry
from offbd_client.models import (
    Ack,
    Asset,
    FaultEvent,
    FaultCode,
    FaultEntry,
    FaultEntryPage,
    FaultPage,
    FaultStatus,
    Fleet,
    Import,
    Problem,
    Profile,
    Replay,
    ReplaySettings,
    Row,
    Rows,
    Series,
    Session,
    SessionPage,
    SessionSort,
    SessionState,
    State,
    Trace,
    Trends,
    VerdictFilter,
)
from offbd_client.types import File

T = TypeVar("T")


def is_a(kind: type[T], answer: Any) -> T:
    """Returns an answer that must be of this type, and not a problem."""
    assert isinstance(answer, kind), answer
    return answer


def numbers(row: dict[str, str]) -> dict[str, float]:
    return {name: float(cell) for name, cell in row.items() if cell}


def read_rows(path: str) -> list[dict[str, float]]:
    with open(path, encoding="utf-8") as file:
        header, *lines = file.read().splitlines()
    names = header.split(",")
    return [numbers(dict(zip(names, line.split(",")))) for line in lines]


def main() -> None:
    address, learnt, sick = sys.argv[1:]
    client = AuthenticatedClient(base_url=address, token=os.environ["CLIENT_TOKEN"])
    with open(learnt, encoding="utf-8") as file:
        description = Asset.from_dict(json.load(file))
    asset = is_a(Asset, create_asset.sync(client=client, body=description))
    again = create_asset.sync_detailed(client=client, body=description)
    assert again.status_code == 409 and is_a(Problem, again.parsed).type_.endswith("asset-exists")

    # A device sends rows; the same rows again count once.
    batch = Rows.from_dict({"session": "monday", "samples": read_rows(sick)})
    first = is_a(Ack, post_telemetry.sync(asset.name, client=client, body=batch))
    again_ack = is_a(Ack, post_telemetry.sync(asset.name, client=client, body=batch))
    assert first.accepted == again_ack.duplicate > 1000 and again_ack.accepted == 0, again_ack
    assert is_a(State, get_state.sync(asset.name, client=client)).session == "monday"
    fleet = is_a(Fleet, get_fleet.sync(client=client, has_fault=True))
    assert [entry.asset for entry in fleet.items] == [asset.name]

    faults = is_a(FaultEntryPage, list_asset_faults.sync(asset.name, client=client)).items
    assert [fault.code for fault in faults] == [FaultCode.X_SERVO], faults
    assert faults[0].status == FaultStatus.CONFIRMED and faults[0].status_byte == "2F"
    everywhere = is_a(FaultEntryPage, list_faults.sync(client=client, code=FaultCode.X_SERVO))
    assert len(everywhere.items) == 1
    servo = FaultCode.X_SERVO
    acknowledged = acknowledge_fault.sync(asset.name, servo, client=client, by="ada")
    assert is_a(FaultEntry, acknowledged).acknowledged
    assert is_a(FaultEntry, get_fault.sync(asset.name, servo, client=client)).acknowledged

    sessions = is_a(SessionPage, list_sessions.sync(client=client, asset=asset.name)).items
    assert [session.state for session in sessions] == [SessionState.OPEN]
    ended = is_a(Session, end_session.sync(sessions[0].id, client=client))
    assert ended.verdict and ended.verdict.faults == [servo], ended
    transitions = is_a(FaultPage, list_session_faults.sync(ended.id, client=client)).items
    assert transitions[-1].status == FaultStatus.CONFIRMED
    event = {"asset": asset.name, "session_id": ended.id, **transitions[-1].to_dict()}
    assert FaultEvent.from_dict(event).code == servo
    assert is_a(Trace, get_trace.sync(ended.id, client=client, points=50)).t_s
    csv = get_session_telemetry.sync_detailed(ended.id, client=client)
    assert csv.status_code == 200 and len(csv.content.splitlines()) == first.accepted + 1

    cleared = clear_fault.sync_detailed(asset.name, servo, client=client, by="ada")
    assert cleared.status_code == 204
    assert not is_a(FaultEntryPage, list_asset_faults.sync(asset.name, client=client)).items

    # The recording is judged again: by the same settings, and by the textbook's.
    for settings, same in (ReplaySettings(), True), (ReplaySettings(profile=Profile.TEXTBOOK), False):
        replay = is_a(Replay, replay_session.sync(ended.id, client=client, body=settings))
        while replay.state in ("queued", "running"):
            time.sleep(0.1)
            replay = is_a(Replay, get_replay.sync(replay.id, client=client))
        assert replay.result and replay.result.same == same, replay

    # A recording is imported as a file, and found by the filters.
    with open(sick, "rb") as recording:
        body = File(payload=recording)
        imported = import_session.sync(asset.name, client=client, body=body, name="tuesday")
    session = is_a(Import, imported).session
    assert is_a(Session, get_session.sync(session.id, client=client)).name == "tuesday"
    oldest = SessionSort.OPENED_AT
    found = list_sessions.sync(client=client, verdict=VerdictFilter.FAULT, sort=oldest)
    assert [one.name for one in is_a(SessionPage, found).items] == ["monday", "tuesday"]
    found = list_sessions.sync(client=client, verdict=VerdictFilter.NO_FAULT)
    assert is_a(SessionPage, found).items == []

    assert is_a(Trends, get_trends.sync(asset.name, client=client)).asset == asset.name
    rows = is_a(Series, get_series.sync(asset.name, client=client)).rows
    assert [row.faulty for row in rows] == [1, 1], rows
    marks = is_a(list, list_annotations.sync(client=client, asset=asset.name))
    assert len(marks) >= 2 and marks[0].time > 1_600_000_000_000, marks

    unknown = is_a(Problem, get_state.sync("nobody", client=client))
    assert unknown.status == 404 and "nobody" in unknown.detail, unknown
    print("the steps of the tour succeed with the generated client")


main()
