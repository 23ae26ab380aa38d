"""Off-board diagnostics with a digital twin, for ball-on-plate rigs.

Judges, calibrates and simulates recordings with the engine of the program `offbd`, and talks
to its service. All quantities are in SI units: `t_s` in s, angles in rad, positions in m.

A *recording* is anything with the Arrow PyCapsule interface (pandas, polars, pyarrow, DuckDB),
or a mapping from column names to NumPy arrays or lists. Its columns are `t_s`, `cmd_qx_rad`,
`cmd_qy_rad`, `x_m`, `y_m` and optionally `seq`; null and NaN are missing values.

An *asset* is the description of a rig: the path of an asset file, a `dict`, or JSON text.
Without one, the rig is that of the book chapter which offbd grew out of.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from os import PathLike
from typing import Any, TypeAlias

from . import _offbd
from ._offbd import Table, __version__
from .client import Acknowledgement, Client, ClientError, Event

__all__ = [
    "Acknowledgement",
    "Client",
    "ClientError",
    "Engine",
    "Event",
    "RejectedRow",
    "SceneRun",
    "Simulation",
    "Table",
    "Verdict",
    "__version__",
    "calibrate",
    "replay",
    "rows",
    "scene",
    "simulate",
]

Asset: TypeAlias = "dict[str, Any] | str | PathLike[str]"
"""A rig: a `dict`, JSON text (which begins with a brace), or the path of an asset file."""


@dataclass(frozen=True)
class RejectedRow:
    """A row that is no sample."""

    row: int
    """Number of the row, from 1."""
    reason: str


@dataclass(frozen=True)
class Verdict:
    """The result of judging a recording."""

    faults: list[dict[str, Any]]
    """The changes of faults, as the lines of `offbd replay --format json`."""
    summary: dict[str, Any]
    """The summary of the session, as the last line of `offbd replay --format json`."""
    rejected: list[RejectedRow]
    """The first rejected rows; `summary["rejected"]` is the number of all."""
    n_set_aside: int
    """Rows that are kept but not judged: too late, or too far ahead in time."""
    evidence: Table | None
    """The quantities of the diagnosis at each judged sample, if they were asked for."""

    @property
    def hash(self) -> str:
        """SHA-256 of the verdict; equal judgements have equal hashes."""
        return str(self.summary["verdict_hash"])

    @property
    def confirmed(self) -> list[str]:
        """The codes of the confirmed faults."""
        return list(self.summary["faults"])


@dataclass(frozen=True)
class Simulation:
    """A simulated session."""

    asset: dict[str, Any]
    """The rig as its owner would describe it."""
    table: Table


@dataclass(frozen=True)
class SceneRun:
    """The run of a scene."""

    model: str
    method: str
    table: Table
    """The trajectory in the plate frame."""


def replay(
    recording: Any,
    asset: Asset | None = None,
    *,
    profile: str | None = None,
    session: str = "session",
    evidence: bool = False,
) -> Verdict:
    """Judges a recording, as `offbd replay` does.

    Raises ValueError if the asset is invalid, a column is missing, or no row is usable.
    """
    faults, summary, rejected, n_set_aside, table = _offbd.replay(
        recording, _asset_text(asset), profile, session, evidence
    )
    bad_rows = [RejectedRow(row, reason) for row, reason in rejected]
    return Verdict(json.loads(faults), json.loads(summary), bad_rows, n_set_aside, table)


def calibrate(asset: Asset, recordings: Sequence[Any]) -> dict[str, Any]:
    """Calibrates a rig from healthy recordings, as `offbd calibrate` does; returns the asset
    with the calibration.

    Raises ValueError that says what is missing if the data are not sufficient.
    """
    text = _asset_text(asset)
    assert text is not None
    made_at = datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    learnt: dict[str, Any] = json.loads(_offbd.calibrate(text, list(recordings), made_at))
    return learnt


def simulate(
    *,
    preset: str = "chapter",
    rig_seed: int | None = None,
    asset: Asset | None = None,
    reference: str = "steps",
    seconds: float = 60.0,
    seed: int = 1,
    faults: Sequence[str] = (),
    seq: bool = False,
) -> Simulation:
    """Simulates a session of a rig, as `offbd simulate` does: equal arguments give equal
    numbers. A fault is CODE:KIND[=SIZE]@START[-END], with times in s; `rig_seed` draws a rig
    instead of the preset.
    """
    file, table = _offbd.simulate(
        preset, rig_seed, _asset_text(asset), reference, seconds, seed, list(faults), seq
    )
    return Simulation(json.loads(file), table)


def scene(
    description: Asset,
    *,
    model: str | None = None,
    method: str | None = None,
    step_s: float | None = None,
    tolerance_m: float = 1e-4,
    sample_s: float = 0.01,
) -> SceneRun:
    """Runs a scene file, as `offbd scene` does. Without a model, one pass starts on the cheapest
    and changes to better ones where the tolerance asks for it; the run names the last of them.
    """
    text = _asset_text(description)
    assert text is not None
    return SceneRun(*_offbd.scene(text, model, method, step_s, tolerance_m, sample_s))


class Engine:
    """Judges the samples of one session as they come."""

    def __init__(
        self, asset: Asset | None = None, *, profile: str | None = None, session: str = "session"
    ) -> None:
        self._native = _offbd.NativeEngine(_asset_text(asset), profile, session)

    def add(self, recording: Any) -> list[dict[str, Any]]:
        """Takes the samples of a recording; returns the changes of faults that they cause."""
        return _lines(self._native.add(recording))

    def add_sample(
        self,
        t_s: float,
        cmd_qx_rad: float | None,
        cmd_qy_rad: float | None,
        x_m: float | None,
        y_m: float | None,
        *,
        seq: int | None = None,
    ) -> list[dict[str, Any]]:
        """Takes one sample; returns the changes of faults that it causes."""
        return _lines(self._native.add_sample(t_s, (cmd_qx_rad, cmd_qy_rad), (x_m, y_m), seq))

    def summary(self) -> dict[str, Any]:
        """The summary of the session so far."""
        summary: dict[str, Any] = json.loads(self._native.summary())
        return summary

    def end(self) -> Verdict:
        """Ends the session; returns its verdict, without rejected rows and evidence."""
        faults, summary = self._native.end()
        return Verdict(json.loads(faults), json.loads(summary), [], 0, None)


def rows(table: Table) -> Iterator[dict[str, Any]]:
    """Yields the rows of a table as dictionaries, for `Client.send`."""
    columns = table.to_pydict()
    for values in zip(*columns.values(), strict=True):
        yield dict(zip(columns, values, strict=True))


def _lines(text: str) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = json.loads(text)
    return lines


def _asset_text(asset: Asset | None) -> str | None:
    """Returns the JSON text of an asset or a scene."""
    if asset is None:
        return None
    if isinstance(asset, dict):
        return json.dumps(asset)
    if isinstance(asset, str) and asset.lstrip().startswith("{"):
        return asset
    with open(asset, encoding="utf-8") as file:
        return file.read()
