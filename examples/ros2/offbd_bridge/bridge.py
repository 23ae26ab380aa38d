"""What the node does, without ROS: samples go to offbd, its faults come back as diagnoses."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

from offbd import Client, ClientError

# Samples that wait for the service. At 100 Hz a network may be away for a quarter of an hour.
CAPACITY = 100_000
# Samples that are sent in one request.
BATCH = 500

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


class Bridge:
    """Sends the samples of one asset and reads its faults.

    A sample is a measured position with the last command before it. Samples wait in memory until
    the service has acknowledged that they are stored, and are sent again until then. If more than
    `capacity` wait, the oldest is dropped and counted in `n_dropped`.
    """

    def __init__(self, client: Client, asset: str, session: str, capacity: int = CAPACITY) -> None:
        self.client = client
        self.asset = asset
        self.session = session
        self.n_dropped = 0
        self.n_refused = 0
        self.last_refusal = ""
        self._capacity = capacity
        self._command: tuple[float | None, float | None] = (None, None)
        self._seq = 0
        self._waiting: deque[dict[str, Any]] = deque()
        self._changed = threading.Condition()

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
        client is patient. In the second case they go on waiting.
        """
        with self._changed:
            batch = [self._waiting[i] for i in range(min(BATCH, len(self._waiting)))]
        if not batch:
            return 0
        try:
            answer = self.client.send(self.asset, batch, session=self.session)
        except ClientError as error:
            if error.status is not None and 400 <= error.status < 500:
                self._refused(len(batch), str(error))
                self._forget(batch[-1]["seq"])
            raise
        for _, reason in answer.rejected:
            self._refused(1, reason)
        self._forget(batch[-1]["seq"])
        return len(batch)

    def diagnoses(self) -> list[Diagnosis]:
        """Asks for the faults of the asset; without an answer all are stale."""
        try:
            faults = list(self.client.faults(self.asset))
        except ClientError as error:
            return [self._diagnosis(STALE, code, str(error)) for code in CODES]
        return self.of_faults(faults)

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
        words = ", ".join(word for word in (fault["status"], fault.get("kind")) if word)
        message = words if fails else f"passes again; on record as {words}"
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
