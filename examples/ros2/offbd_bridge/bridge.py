"""What the node does, without ROS: samples go to offbd, its faults come back as diagnoses."""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

from offbd import Client, ClientError

# Samples that wait for the service. At 100 Hz a network may be away for a quarter of an hour.
CAPACITY = 100_000
# Samples that are sent in one request.
BATCH = 500
# Faults that are known are shown for so long without a newer answer, s.
FRESH_S = 5.0

# Weight from which on a kind is stated as a fact; the program has the same limit.
SURE = 0.8

# Levels of diagnostic_msgs/DiagnosticStatus.
OK, WARN, ERROR, STALE = 0, 1, 2, 3

CODES = {
    "x_servo": "x servo",
    "y_servo": "y servo",
    "stuck_ball": "ball",
    "sensor": "position sensor",
}


class Diagnosis(NamedTuple):
    """The content of a diagnostic_msgs/DiagnosticStatus."""

    level: int
    name: str
    message: str
    values: dict[str, str]


def kind_words(fault: Mapping[str, Any]) -> str:
    """Returns the kind of a fault, `dead` or `probably dead, 51 %`; empty if it is not known."""
    kind: str = fault.get("kind") or ""
    weights = [each["weight"] for each in fault.get("candidates", []) if each["kind"] == kind]
    if not kind or not weights or weights[0] >= SURE:
        return kind
    return f"probably {kind}, {100 * weights[0]:.0f} %"


class Bridge:
    """Sends the samples of one asset and reads its faults.

    A sample is a measured position with the last command before it. Samples wait in memory until
    the service has acknowledged that they are stored, and are sent again until then. If more than
    `capacity` wait, the oldest is dropped and counted in `n_dropped`. What the service refuses for
    good is counted in `n_refused`. If the session has ended, the next samples go to another one,
    `SESSION-2` and so on.
    """

    def __init__(self, client: Client, asset: str, session: str, capacity: int = CAPACITY) -> None:
        self.client = client
        self.asset = asset
        self.session = session
        self._sessions = (f"{session}-{n}" for n in itertools.count(2))
        self.n_dropped = 0
        self.n_refused = 0
        self.last_refusal = ""
        self._capacity = capacity
        self._command: tuple[float | None, float | None] = (None, None)
        self._seq = 0
        self._waiting: deque[dict[str, Any]] = deque()
        # The last sample of a batch of which it is not known whether it is stored.
        self._attempted: int | None = None
        self._changed = threading.Condition()
        self._known: tuple[float, list[Diagnosis]] | None = None
        self._reason = "not asked yet"

    def command(self, qx_rad: float, qy_rad: float) -> None:
        """Takes a command of the plate's angles."""
        self._command = (qx_rad, qy_rad)

    def position(self, t_s: float, x_m: float | None, y_m: float | None) -> None:
        """Takes a measured position; None where the ball was not seen."""
        qx, qy = self._command
        with self._changed:
            sample = {"seq": self._seq, "t_s": t_s, "x_m": x_m, "y_m": y_m}
            self._waiting.append(sample | {"cmd_qx_rad": qx, "cmd_qy_rad": qy})
            self._seq += 1
            if len(self._waiting) > self._capacity:
                self._waiting.popleft()
                self.n_dropped += 1
            self._changed.notify()

    def wait(self, timeout_s: float) -> bool:
        """Waits for samples; returns whether there are any."""
        with self._changed:
            return self._changed.wait_for(lambda: bool(self._waiting), timeout_s)

    def deliver(self) -> int:
        """Sends the samples that wait, oldest first, and returns their number once they are stored.

        Raises ClientError if the service refuses them, or cannot be reached for as long as the
        client is patient. Unless it has refused them for good, they go on waiting.
        """
        batch = self._batch()
        if not batch:
            return 0
        last_seq = self._attempted = batch[-1]["seq"]
        try:
            answer = self.client.send(self.asset, batch, session=self.session)
        except ClientError as error:
            if error.session_ended:
                self.session = next(self._sessions)
            elif error.is_final:
                self._refused(len(batch), str(error))
                self._forget(last_seq)
            raise
        for _, reason in answer.rejected:
            self._refused(1, reason)
        self._forget(last_seq)
        return len(batch)

    def _batch(self) -> list[dict[str, Any]]:
        """The samples to send: the same as at the last attempt, if its outcome is not known, so
        that those that are stored already are not sent to another session."""
        with self._changed:
            batch = list(itertools.islice(self._waiting, BATCH))
        again = [s for s in batch if self._attempted is not None and s["seq"] <= self._attempted]
        return again or batch

    def refresh(self) -> None:
        """Asks for the faults of the asset, which may take long on a bad network."""
        try:
            faults = list(self.client.faults(self.asset))
        except ClientError as error:
            self._reason = str(error)
            return
        self._known = (time.monotonic(), self.of_faults(faults))

    def diagnoses(self) -> list[Diagnosis]:
        """Returns the faults as of the last `refresh`, without waiting; if it is old, all are
        stale.
        """
        known = self._known
        if known is not None and time.monotonic() - known[0] <= FRESH_S:
            return known[1]
        return [self._diagnosis(STALE, code, self._reason) for code in CODES]

    def of_faults(self, faults: list[dict[str, Any]]) -> list[Diagnosis]:
        """Returns one diagnosis for each fault code from the faults on record."""
        by_code = {fault["code"]: fault for fault in faults}
        return [self._of_code(code, by_code.get(code)) for code in CODES]

    def _of_code(self, code: str, fault: Mapping[str, Any] | None) -> Diagnosis:
        if fault is None:
            return self._diagnosis(OK, code, "no fault on record")
        # Bit 0 of the status byte of ISO 14229: the test fails at present.
        fails = int(fault["status_byte"], 16) & 1 == 1
        level = ERROR if fails and fault["status"] == "confirmed" else WARN
        status = "suspected" if fault["status"] == "pending" else fault["status"]
        words = ", ".join(word for word in (status, kind_words(fault)) if word)
        message = words if fails else f"passing again; was {words}"
        keys = ("status", "status_byte", "kind", "occurrences", "trips")
        values = {key: str(fault[key]) for key in keys if fault.get(key)}
        return self._diagnosis(level, code, message, values)

    def _diagnosis(
        self, level: int, code: str, message: str, values: dict[str, str] | None = None
    ) -> Diagnosis:
        return Diagnosis(level, f"{self.asset}: {CODES[code]}", message, values or {})

    def _refused(self, n: int, reason: str) -> None:
        self.n_refused += n
        self.last_refusal = reason

    def _forget(self, last_seq: int) -> None:
        with self._changed:
            while self._waiting and self._waiting[0]["seq"] <= last_seq:
                self._waiting.popleft()
