"""A client of the service, with the standard library only."""

from __future__ import annotations

import http.client
import json
import logging
import random
import ssl
import time
import urllib.parse
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, cast

from .connection import Connection, Reply, Request

if TYPE_CHECKING:
    from . import documents as doc

ATTEMPT_TIMEOUT_S = 30.0
"""Longest time without an answer, s; then the request counts as failed."""
MAX_DELAY_S = 30.0
"""Longest delay between two attempts, s."""
FIRST_DELAY_S = 0.2
"""Delay after the first failed attempt, s; it doubles with each further one."""
PATIENCE_S = 60.0
"""Longest time for which a request is sent again, s, if the caller does not say."""
MAX_BATCH_ROWS = 500
"""Most samples of one request; more are sent in several."""
NO_CONTENT = 204
"""Status of an answer without content."""
RETRIED = (408, 425, 429)
"""Statuses below 500 after which a request may succeed unchanged."""
NEVER = (501, 505)
"""Statuses from 500 on after which it will not."""
FINAL = (400, 409, 413, 415, 422)
"""Statuses with which the service refuses samples for good, as all of its clients see it."""
PROBLEM_TYPE = "urn:offbd:problem:"
"""How the types of the service's problems begin."""
MAX_EXCERPT = 200
"""Most characters of an answer that an error repeats."""

FaultFilter: TypeAlias = Literal["active", "pending", "confirmed", "healed", "cleared", "all"]
"""Selects faults by status; active means pending or confirmed."""
AlarmFilter: TypeAlias = Literal["failing", "suspected", "on_record", "active", "all"]
"""Selects alarms; active means failing, suspected or on record."""

_log = logging.getLogger("offbd")


class ClientError(Exception):
    """The service has refused a request, or could not be reached in time."""

    def __init__(self, message: str, status: int | None = None, problem: Any = None) -> None:
        super().__init__(message)
        self.status = status
        """The status of the answer; None without an answer."""
        self.problem = problem
        """The problem document (RFC 9457) of the answer, if it has one."""
        self.retry_after_s = 0.0
        """The delay that the service asks for, s."""

    def at(self, place: str) -> ClientError:
        """Returns the error with the request that failed."""
        return ClientError(f"{place}: {self}", self.status, self.problem)

    @property
    def is_final(self) -> bool:
        """Whether the service itself has refused what was sent, and would refuse it again.
        Anything else may pass: an asset or a token may come, and what a proxy answers says
        nothing about the samples.
        """
        return self.status in FINAL and self._kind().startswith(PROBLEM_TYPE)

    @property
    def session_ended(self) -> bool:
        """Whether the session has ended: new samples belong to another one."""
        return self._kind() == PROBLEM_TYPE + "session-ended"

    def _kind(self) -> str:
        return str(self.problem.get("type", "")) if isinstance(self.problem, dict) else ""


@dataclass
class Acknowledgement:
    """What the service has done with samples; they are stored durably."""

    accepted: int = 0
    """Number of recorded samples."""
    duplicate: int = 0
    """Number of samples that were recorded before."""
    rejected: list[tuple[int, str]] = field(default_factory=list)
    """Index in the sent samples and reason of each invalid sample."""
    session: str | None = None
    """Name of the session."""
    session_id: str | None = None
    """The service's id of the session."""


@dataclass(frozen=True)
class Event:
    """A change of a fault's status."""

    id: int
    data: doc.FaultEvent


class Client:
    """Talks to the service at `url`, with a bearer token if one is given.

    A request that fails for a reason that may pass (no connection, a cut answer, 408, 425, 429,
    5xx but for 501 and 505) is sent again with growing delays, for `patience_s` seconds at most;
    None means for ever. Each such failure is a warning of the logger `offbd`. Sent telemetry is
    idempotent: a sample that arrives twice is stored once.

    One connection stays open between requests, until `close` or the end of a `with` statement.
    Threads may share a client.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:8087",
        *,
        token: str | None = None,
        patience_s: float | None = PATIENCE_S,
        context: ssl.SSLContext | None = None,
    ) -> None:
        self._base = url.rstrip("/") + "/api/v1"
        self._path = urllib.parse.urlsplit(self._base).path
        self._connection = Connection(url, ATTEMPT_TIMEOUT_S, context)
        self._token = token
        self._patience_s = patience_s

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connection; a later request opens it again."""
        self._connection.close()

    def assets(self) -> list[doc.Asset]:
        """Returns all assets."""
        return list(self._items("/assets", {}))

    def fleet(self) -> Iterator[doc.FleetEntry]:
        """Yields an overview of each asset: its open session, its last data, its faults."""
        return self._items("/fleet", {})

    def asset(self, name: str) -> doc.Asset:
        """Returns an asset with its description and calibration."""
        return cast("doc.Asset", self._object("GET", f"/assets/{_part(name)}"))

    def state(self, asset: str) -> doc.State:
        """Returns the present state of an asset: its evidence, its monitors, its twin."""
        return cast("doc.State", self._object("GET", f"/assets/{_part(asset)}/state"))

    def put_asset(self, name: str, description: Mapping[str, Any]) -> doc.Asset:
        """Registers the asset `name`, or replaces its description."""
        body = {**description, "name": name}
        return cast("doc.Asset", self._object("PUT", f"/assets/{_part(name)}", body))

    def send(
        self, asset: str, samples: Iterable[Mapping[str, Any]], *, session: str | None = None
    ) -> Acknowledgement:
        """Sends samples and returns when all are stored durably. They are taken from the
        iterable batch by batch, so that it may be long.
        """
        total = Acknowledgement()
        n_sent = 0
        for batch in _batches(samples):
            body: dict[str, Any] = {"samples": batch}
            if session is not None:
                body["session"] = session
            path = f"/assets/{_part(asset)}/telemetry"
            answer = self._object("POST", path, body, _acknowledges(len(batch)))
            total.accepted += answer["accepted"]
            total.duplicate += answer["duplicate"]
            total.rejected += [(n_sent + row["index"], row["reason"]) for row in answer["rejected"]]
            total.session = answer["session"] or total.session
            total.session_id = answer["session_id"] or total.session_id
            n_sent += len(batch)
        return total

    def sessions(self, asset: str | None = None) -> Iterator[doc.Session]:
        """Yields the sessions of an asset, or of all."""
        return self._items("/sessions", {"asset": asset})

    def session(self, session_id: str) -> doc.Session:
        """Returns a session by the service's id."""
        return cast("doc.Session", self._object("GET", f"/sessions/{_part(session_id)}"))

    def end_session(self, session_id: str) -> doc.Session:
        """Ends a session; returns it with its verdict."""
        return cast("doc.Session", self._object("POST", f"/sessions/{_part(session_id)}/end"))

    def recording(self, session_id: str) -> list[doc.Sample]:
        """Returns the samples of a session."""
        answer = self._object("GET", f"/sessions/{_part(session_id)}/telemetry")
        samples: list[doc.Sample] = answer["samples"]
        return samples

    def import_session(
        self, asset: str, content: bytes, *, name: str | None = None, media_type: str = "text/csv"
    ) -> doc.Import:
        """Imports the content of a recorded file as a session, and ends it; returns the session
        with its verdict, and the counts of rows. Without a `name`, a file is stored twice if the
        first answer is lost; with one, the second attempt is refused with 409. The media type
        says which format it is, such as application/vnd.apache.parquet.
        """
        path = f"/assets/{_part(asset)}/sessions/import" + _query({"name": name})
        result: doc.Import = self._answer("POST", path, content, media_type)
        return result

    def series(
        self,
        asset: str,
        *,
        after: str | None = None,
        before: str | None = None,
        step_s: int | None = None,
        aggregate: doc.SeriesAggregate | None = None,
    ) -> doc.Series:
        """Returns the results of an asset's ended sessions over time, of those opened from
        `after` on and before `before`, both RFC 3339: a row for each session, or for each step
        of `step_s`.
        """
        query = {"from": after, "to": before, "step_s": step_s, "aggregate": aggregate}
        path = f"/assets/{_part(asset)}/series"
        return cast("doc.Series", self._object("GET", path + _query(query)))

    def faults(
        self, asset: str | None = None, *, status: FaultFilter = "active"
    ) -> Iterator[doc.FaultEntry]:
        """Yields the faults of an asset, or of all."""
        path = "/faults" if asset is None else f"/assets/{_part(asset)}/faults"
        return self._items(path, {"status": status})

    def acknowledge_fault(self, asset: str, code: doc.FaultCode, by: str) -> doc.FaultEntry:
        """Acknowledges the present occurrence of a fault in the name of `by`; with a token, in
        that of the token.
        """
        path = f"/assets/{_part(asset)}/faults/{_part(code)}/acknowledge"
        return cast("doc.FaultEntry", self._object("POST", path + _query({"by": by})))

    def clear_fault(self, asset: str, code: doc.FaultCode, by: str) -> None:
        """Erases the entry of a fault in the name of `by`; with a token, in that of the token."""
        path = f"/assets/{_part(asset)}/faults/{_part(code)}"
        self._answer("DELETE", path + _query({"by": by}))

    def fault_history(self, asset: str, code: doc.FaultCode) -> Iterator[doc.History]:
        """Yields the changes of a fault, newest first, and who acknowledged or cleared it."""
        return self._items(f"/assets/{_part(asset)}/faults/{_part(code)}/history", {})

    def alarms(
        self, asset: str | None = None, *, state: AlarmFilter = "active"
    ) -> Iterator[doc.Alarm]:
        """Yields the alarms of an asset, or of all: faults that fail or are on record, and rigs
        without data during a session. `state` is failing, on_record, active or all.
        """
        return self._items("/alarms", {"asset": asset, "state": state})

    def learning(self, asset: str) -> doc.Learning:
        """Returns what an asset has learnt by itself, and what it lacks."""
        return cast("doc.Learning", self._object("GET", f"/assets/{_part(asset)}/learning"))

    def accept_learning(self, asset: str, by: str) -> doc.Learning:
        """Puts the calibration that an asset offers into use, in the name of `by`, who thereby
        confirms that the rig was healthy; with a token, in that of the token.
        """
        path = f"/assets/{_part(asset)}/learning/accept"
        return cast("doc.Learning", self._object("POST", path + _query({"by": by})))

    def calibrate(
        self, asset: str, session_ids: Sequence[str], by: str | None = None, *, poll_s: float = 0.2
    ) -> doc.CalibrationJob:
        """Calibrates an asset from healthy sessions; returns the finished job with the calibration,
        which `activate_calibration` puts into use.
        """
        path = f"/assets/{_part(asset)}/calibrations"
        body = {"sessions": list(session_ids)}
        job = self._object("POST", path + _query({"by": by}), body)
        return cast("doc.CalibrationJob", self._finished(path, job, poll_s))

    def activate_calibration(
        self, asset: str, calibration_id: str, by: str | None = None
    ) -> doc.CalibrationJob:
        """Puts the calibration of a job into use, from the next session on."""
        path = f"/assets/{_part(asset)}/calibrations/{_part(calibration_id)}/activate"
        return cast("doc.CalibrationJob", self._object("POST", path + _query({"by": by})))

    def replay(
        self,
        session_id: str,
        settings: doc.ReplaySettings | None = None,
        *,
        poll_s: float = 0.2,
    ) -> doc.Replay:
        """Judges a recorded session again, with other settings if given; returns the finished
        replay with its result.
        """
        job = self._object("POST", f"/sessions/{_part(session_id)}/replays", dict(settings or {}))
        return cast("doc.Replay", self._finished("/replays", job, poll_s))

    def _finished(self, path: str, job: dict[str, Any], poll_s: float) -> dict[str, Any]:
        """Returns a job below `path` once it has finished. Raises ClientError if it has failed."""
        while job["state"] not in ("done", "failed"):
            time.sleep(poll_s)
            job = self._object("GET", f"{path}/{_part(job['id'])}")
        if job["state"] == "failed":
            raise ClientError(f"the job {path}/{job['id']} failed: {job['error']}")
        return job

    def events(self, asset: str | None = None, *, after: int | None = None) -> Iterator[Event]:
        """Yields the changes of faults as they become durable, for ever; after a lost
        connection it asks for those that it missed. `after` is the id of the last known event,
        0 for all that are stored.
        """
        delay_s = FIRST_DELAY_S
        while True:
            request = self._request("GET", "/events" + _query({"asset": asset, "after": after}))
            try:
                with self._connection.stream(request) as answer:
                    if answer.status >= 300:
                        reply = Reply(answer.status, answer.reason, answer.headers, answer.read())
                        raise _refusal(reply)
                    for event_id, kind, data in _messages(answer):
                        after, delay_s = event_id, FIRST_DELAY_S
                        if kind == "fault":
                            yield Event(event_id, json.loads(data))
                reason = "the answer has ended"
            except ClientError as error:
                if not _may_pass(error.status):
                    raise
                reason = str(error)
            except (OSError, http.client.HTTPException) as error:
                reason = _named(error)
            _log.warning("events of %s: %s; asking again", self._base, reason)
            time.sleep(delay_s * random.uniform(0.8, 1.2))
            delay_s = min(2 * delay_s, MAX_DELAY_S)

    def _items(self, path: str, query: Mapping[str, Any]) -> Iterator[Any]:
        """Yields the items of all pages of a list."""
        cursor = None
        while True:
            page = self._object("GET", path + _query({**query, "cursor": cursor}))
            yield from page["items"]
            cursor = page.get("next")
            if cursor is None:
                return

    def _object(
        self,
        method: str,
        path: str,
        body: Any = None,
        is_expected: Callable[[Any], bool] = lambda value: isinstance(value, dict),
    ) -> dict[str, Any]:
        """Sends a request until it succeeds; returns the JSON object of the answer."""
        content = None if body is None else json.dumps(body).encode()
        value: dict[str, Any] = self._answer(method, path, content, is_expected=is_expected)
        return value

    def _answer(
        self,
        method: str,
        path: str,
        content: bytes | None = None,
        kind: str = "application/json",
        is_expected: Callable[[Any], bool] = lambda value: True,
    ) -> Any:
        """Sends a request with content of the media type `kind` until it succeeds; returns the
        JSON of the answer, None if it has no content. An answer that is not expected is not
        the service's.
        """
        request = self._request(method, path, content, kind)
        start = time.monotonic()
        delay_s = FIRST_DELAY_S
        while True:
            try:
                return _value(self._connection.send(request), is_expected)
            except ClientError as error:
                failure, may_pass = error, _may_pass(error.status)
            except (OSError, http.client.HTTPException) as error:
                failure = ClientError(_named(error))
                # Any other exception of HTTP means that the peer does not speak it.
                may_pass = isinstance(error, OSError | http.client.IncompleteRead)
            waited_s = time.monotonic() - start
            pause_s = max(delay_s, failure.retry_after_s) * random.uniform(0.8, 1.2)
            if not may_pass:
                raise failure.at(f"{method} {self._base}{path}")
            if self._patience_s is not None and waited_s + pause_s > self._patience_s:
                raise failure.at(f"{method} {self._base}{path}: tried for {waited_s:.0f} s")
            _log.warning(
                "%s %s%s: %s; trying again in %.1f s", method, self._base, path, failure, pause_s
            )
            time.sleep(pause_s)
            delay_s = min(2 * max(delay_s, failure.retry_after_s), MAX_DELAY_S)

    def _request(
        self, method: str, path: str, content: bytes | None = None, kind: str = "application/json"
    ) -> Request:
        headers = {"Accept": "application/json, text/event-stream"}
        if content is not None:
            headers["Content-Type"] = kind
        if self._token is not None:
            headers["Authorization"] = f"Bearer {self._token}"
        return Request(method, self._path + path, content, headers)


def _batches(samples: Iterable[Mapping[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    batch: list[dict[str, Any]] = []
    for sample in samples:
        batch.append(dict(sample))
        if len(batch) == MAX_BATCH_ROWS:
            yield batch
            batch = []
    if batch:
        yield batch


def _messages(lines: Iterable[bytes]) -> Iterator[tuple[int, str, str]]:
    """Yields id, type and data of each message of a stream of Server-Sent Events."""
    fields: dict[str, str] = {}
    for line in lines:
        text = line.decode().rstrip("\r\n")
        if text:
            name, _, value = text.partition(":")
            fields[name] = value.removeprefix(" ")
        elif "id" in fields:
            yield int(fields["id"]), fields.get("event", "message"), fields.get("data", "")
            fields = {}
        else:
            fields = {}


def _may_pass(status: int | None) -> bool:
    """Whether a request may succeed unchanged after an answer with this status, or after none."""
    return status is None or status in RETRIED or (status >= 500 and status not in NEVER)


def _acknowledges(n_sent: int) -> Callable[[Any], bool]:
    """Returns what tells an acknowledgement of so many samples from any other answer."""

    def is_acknowledgement(value: Any) -> bool:
        try:
            n_told = value["accepted"] + value["duplicate"] + len(value["rejected"])
            return bool(n_told == n_sent) and {"session", "session_id"} <= value.keys()
        except (TypeError, KeyError, AttributeError):
            return False

    return is_acknowledgement


def _value(reply: Reply, is_expected: Callable[[Any], bool]) -> Any:
    """Returns the JSON of an answer; ClientError if it is a refusal, or not what is expected."""
    if reply.status >= 300:
        raise _refusal(reply)
    if reply.status == NO_CONTENT:
        return None
    try:
        value = json.loads(reply.content)
        if is_expected(value):
            return value
    except ValueError:
        pass
    told = _excerpt(reply.content.decode(errors="replace"))
    text = f"{reply.status} {reply.reason}, but not an answer of offbd: {told}"
    raise ClientError(text, reply.status)


def _named(error: Exception) -> str:
    """An error in words, also one that has none."""
    return str(error) or type(error).__name__


def _excerpt(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= MAX_EXCERPT else text[:MAX_EXCERPT] + "…"


def _refusal(reply: Reply) -> ClientError:
    try:
        problem = json.loads(reply.content)
        detail = problem.get("detail") or problem.get("title")
    except (ValueError, AttributeError):
        problem, detail = None, _excerpt(reply.content.decode(errors="replace"))
    if "Location" in reply.headers:
        detail = f"the service is at {reply.headers['Location']}"
    failure = ClientError(f"{reply.status} {reply.reason}: {detail}", reply.status, problem)
    failure.retry_after_s = _retry_after_s(reply)
    return failure


def _retry_after_s(reply: Reply) -> float:
    """Returns the delay that the service asks for, s, up to a minute."""
    try:
        return min(max(float(reply.headers.get("Retry-After", 0)), 0.0), 60.0)
    except ValueError:
        return 0.0


def _part(text: str) -> str:
    return urllib.parse.quote(text, safe="")


def _query(values: Mapping[str, Any]) -> str:
    given = {name: value for name, value in values.items() if value is not None}
    return "?" + urllib.parse.urlencode(given) if given else ""
