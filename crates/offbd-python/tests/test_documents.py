"""The types of documents and words agree with what the program and the service return."""

from __future__ import annotations

import json
import typing
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, is_typeddict

import pytest
import typing_extensions
from conftest import Service

import offbd
from offbd import documents

NAMES = {**vars(documents), "NotRequired": typing_extensions.NotRequired}


def check(value: Any, expected: Any, place: str = "") -> None:
    """Fails unless `value` is of the type `expected`, with no key that the type lacks."""
    origin = get_origin(expected)
    if is_typeddict(expected):
        fields = typing_extensions.get_type_hints(expected, None, NAMES, include_extras=True)
        lacking = {key for key, of in fields.items() if not is_optional(of)} - value.keys()
        assert not lacking and value.keys() <= fields.keys(), (place, lacking, list(value))
        for key, one in value.items():
            check(one, fields[key], f"{place}/{key}")
    elif is_optional(expected):
        check(value, get_args(expected)[0], place)
    elif origin is list:
        for index, one in enumerate(value):
            check(one, get_args(expected)[0], f"{place}/{index}")
    elif origin is Literal:
        assert value in get_args(expected), (place, value)
    elif origin is dict:
        for key, one in value.items():
            check(one, get_args(expected)[1], f"{place}/{key}")
    elif origin in (Union, type(int | str)):
        check_union(value, get_args(expected), place)
    elif expected is float:
        assert isinstance(value, float | int), (place, value)
    elif expected is not Any:
        assert isinstance(value, expected), (place, value, expected)


def is_optional(of: Any) -> bool:
    return get_origin(of) in (typing_extensions.NotRequired, getattr(typing, "NotRequired", None))


def check_union(value: Any, members: tuple[Any, ...], place: str) -> None:
    failures = []
    for member in members:
        try:
            return check(value, member, place)
        except (AssertionError, AttributeError, TypeError) as failure:
            failures.append(failure)
    raise AssertionError(f"{place}: {failures}")


def test_what_the_package_returns_has_its_types(folder: Path) -> None:
    healthy = offbd.simulate(reference="lissajous", seconds=60)
    check(healthy.asset, documents.Asset)
    check(offbd.calibrate(healthy.asset, healthy.table), documents.Asset)
    verdict = offbd.replay(folder / "sick.csv", folder / "calibrated.json")
    assert verdict.faults
    check(verdict.faults, list[documents.Fault])
    check(verdict.summary, documents.Summary)
    with pytest.raises(AssertionError, match="code"):
        check({**verdict.faults[0], "code": "z_servo"}, documents.Fault)
    with pytest.raises(AssertionError, match="fresh"):
        check({**verdict.summary, "fresh": 1}, documents.Summary)
    with pytest.raises(AssertionError, match="t_s"):
        check({k: v for k, v in verdict.faults[0].items() if k != "t_s"}, documents.Fault)


def test_what_the_client_returns_has_its_types(service: Service, folder: Path) -> None:
    with offbd.Client(service.url) as client:
        learnt = json.loads((folder / "calibrated.json").read_text())
        check(client.put_asset("rig", learnt), documents.Asset)
        check(client.assets(), list[documents.Asset])
        healthy = client.import_session("rig", (folder / "healthy.csv").read_bytes())
        check(healthy, documents.Import)
        session = healthy["session"]["id"]
        client.import_session("rig", (folder / "sick.csv").read_bytes())
        sessions = list(client.sessions("rig"))
        assert len(sessions) == 2
        check(sessions, list[documents.Session])
        check(client.recording(session), list[documents.Sample])
        check(client.replay(session, {"profile": "textbook"}), documents.Replay)
        faults, alarms = list(client.faults("rig")), list(client.alarms("rig"))
        assert faults and alarms
        check(faults, list[documents.FaultEntry])
        check(alarms, list[documents.Alarm])
        check(client.acknowledge_fault("rig", "x_servo", "Ada"), documents.FaultEntry)
        check(list(client.fault_history("rig", "x_servo")), list[documents.History])
        check(client.series("rig"), documents.Series)
        check(next(client.events("rig", after=0)).data, documents.FaultEvent)
        check(client.state("rig"), documents.State)
        check(client.learning("rig"), documents.Learning)
        fleet = list(client.fleet())
        assert [entry["asset"] for entry in fleet] == ["rig"]
        check(fleet, list[documents.FleetEntry])


def words(call: Any) -> list[str]:
    """The words that offbd expects, as its error for another one lists them."""
    with pytest.raises(ValueError, match="one of") as refusal:
        call()
    return str(refusal.value).partition("one of ")[2].split(", ")


@pytest.mark.parametrize(
    ("literal", "call"),
    [
        (documents.Profile, lambda word: offbd.replay({}, profile=word)),
        (offbd.Preset, lambda word: offbd.simulate(preset=word)),
        (offbd.Reference, lambda word: offbd.simulate(reference=word)),
        (offbd.SceneModel, lambda word: offbd.scene("{}", model=word)),
        (offbd.SceneMethod, lambda word: offbd.scene("{}", model="rolling", method=word)),
    ],
)
def test_words_are_those_of_the_program(literal: Any, call: Any) -> None:
    assert list(get_args(literal)) == words(lambda: call("nonsense"))
