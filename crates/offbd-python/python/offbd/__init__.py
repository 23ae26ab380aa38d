"""Off-board diagnostics with a digital twin, for ball-on-plate rigs.

Judges, calibrates and simulates recordings with the engine of the program `offbd`, and talks
to its service. All quantities are in SI units: `t_s` in s, angles in rad, positions in m.

A *recording* is the path of a session file, in any format that the program reads; or anything
with the Arrow PyCapsule interface (pandas, polars, pyarrow, DuckDB); or a mapping from column
names to NumPy arrays or lists. The columns of a table are `t_s`, `cmd_qx_rad`, `cmd_qy_rad`,
`x_m`, `y_m` and optionally `seq`; null and NaN are missing values. They may have other names and
units: the argument `columns` says which is which, such as "t_s=time/ms, x_m=ball_x/mm", or else
`columns` of the asset; `rate_hz` is the number of rows a second of a recording without a time.

An *asset* is the description of a rig: the path of an asset file, a `dict`, or JSON text.
Without one, the rig is that of the book chapter which offbd grew out of.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, cast

from . import _offbd
from ._offbd import Table, __version__
from .client import Acknowledgement, Client, ClientError, Event
from .verdict import RejectedRow, Verdict

if TYPE_CHECKING:
    from . import documents as doc

__all__ = [
    "Acknowledgement",
    "Client",
    "ClientError",
    "Engine",
    "Event",
    "Preset",
    "Reference",
    "RejectedRow",
    "SceneMethod",
    "SceneModel",
    "SceneRun",
    "Simulation",
    "Table",
    "Verdict",
    "__version__",
    "calibrate",
    "read",
    "replay",
    "rows",
    "scene",
    "simulate",
]

Asset: TypeAlias = "Mapping[str, Any] | str | PathLike[str]"
"""A rig: a mapping, JSON text (which begins with a brace), or the path of an asset file."""
Preset: TypeAlias = Literal["chapter", "pingpong", "touch"]
"""A rig that is simulated."""
Reference: TypeAlias = Literal["hold", "steps", "circle", "lissajous"]
"""The motion that the controller of a simulated rig commands."""
SceneModel: TypeAlias = Literal["planar", "rolling", "creeping", "sliding", "compliant"]
"""A plant model of a scene."""
SceneMethod: TypeAlias = Literal[
    "zoh",
    "euler",
    "semi-implicit-euler",
    "midpoint",
    "rk4",
    "dopri5",
    "rodas3",
    "rodas4",
    "contact-step",
]
"""A method of integration."""


@dataclass(frozen=True)
class Simulation:
    """A simulated session."""

    asset: doc.Asset
    """The rig as its owner would describe it."""
    table: Table


@dataclass(frozen=True)
class SceneRun:
    """The run of a scene."""

    model: SceneModel
    method: SceneMethod
    table: Table
    """The trajectory in the plate frame."""


def read(
    recording: Any,
    asset: Asset | None = None,
    *,
    columns: str | None = None,
    rate_hz: float | None = None,
) -> list[Table]:
    """Reads a recording; returns a table for each run. A recording has one run unless its clock
    starts again. Warns if rows are rejected.

    Raises OSError if the file cannot be read, and ValueError if it is not a recording.
    """
    return _offbd.read(recording, _asset_text(asset), columns, rate_hz)


def replay(
    recording: Any,
    asset: Asset | None = None,
    *,
    profile: doc.Profile | None = None,
    session: str | None = None,
    evidence: bool = False,
    columns: str | None = None,
    rate_hz: float | None = None,
) -> Verdict:
    """Judges a recording, as `offbd replay` does. A session without a name has that of its file.

    Raises OSError if the file cannot be read, and ValueError if the asset is invalid, the file
    is not a recording or has several runs, a column is missing, or no row is usable.
    """
    faults, summary, rejected, n_set_aside, table = _offbd.replay(
        recording, _asset_text(asset), profile, session, evidence, columns, rate_hz
    )
    bad_rows = [RejectedRow(row, reason) for row, reason in rejected]
    return Verdict(json.loads(faults), json.loads(summary), bad_rows, n_set_aside, table)


def calibrate(
    asset: Asset,
    recordings: Any,
    *,
    columns: str | None = None,
    rate_hz: float | None = None,
) -> doc.Asset:
    """Calibrates a rig from a healthy recording or a sequence of them, as `offbd calibrate` does;
    returns the asset with the calibration.

    Raises OSError if a file cannot be read, and ValueError that says what is missing if the data
    are not sufficient.
    """
    text = _asset_text(asset)
    assert text is not None
    made_at = datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    sources = list(recordings) if _is_sequence(recordings) else [recordings]
    learnt: doc.Asset = json.loads(_offbd.calibrate(text, sources, made_at, columns, rate_hz))
    return learnt


def simulate(
    *,
    preset: Preset = "chapter",
    rig_seed: int | None = None,
    asset: Asset | None = None,
    reference: Reference = "steps",
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
    model: SceneModel | None = None,
    method: SceneMethod | None = None,
    step_s: float | None = None,
    tolerance_m: float = 1e-4,
    sample_s: float = 0.01,
) -> SceneRun:
    """Runs a scene file, as `offbd scene` does. Without a model, one pass starts on the cheapest
    and changes to better ones where the tolerance asks for it; the run names the last of them.
    """
    text = _asset_text(description)
    assert text is not None
    ran = _offbd.scene(text, model, method, step_s, tolerance_m, sample_s)
    return SceneRun(cast(SceneModel, ran[0]), cast(SceneMethod, ran[1]), ran[2])


class Engine:
    """Judges the samples of one session as they come. A copy by `pickle` goes on as the original
    does, to the bit; only the same version of offbd reads it.
    """

    def __init__(
        self,
        asset: Asset | None = None,
        *,
        profile: doc.Profile | None = None,
        session: str = "session",
    ) -> None:
        self._native = _offbd.NativeEngine(_asset_text(asset), profile, session)

    def add(self, recording: Any) -> list[doc.Fault]:
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
    ) -> list[doc.Fault]:
        """Takes one sample; returns the changes of faults that it causes."""
        return _lines(self._native.add_sample(t_s, (cmd_qx_rad, cmd_qy_rad), (x_m, y_m), seq))

    def summary(self) -> doc.Summary:
        """The summary of the session so far."""
        summary: doc.Summary = json.loads(self._native.summary())
        return summary

    def __getstate__(self) -> tuple[str, bytes]:
        return self._native.state()

    def __setstate__(self, state: tuple[str, bytes]) -> None:
        self._native = _offbd.NativeEngine.of_state(*state)

    def end(self) -> Verdict:
        """Ends the session; returns its verdict, without rejected rows and evidence."""
        faults, summary = self._native.end()
        return Verdict(json.loads(faults), json.loads(summary), [], 0, None)


def rows(table: Table) -> Iterator[dict[str, Any]]:
    """Yields the rows of a table as dictionaries, for `Client.send`."""
    columns = table.to_pydict()
    for values in zip(*columns.values(), strict=True):
        yield dict(zip(columns, values, strict=True))


def _is_sequence(recordings: Any) -> bool:
    """Whether this is several recordings, not one: a table can be iterated, too."""
    is_table = hasattr(recordings, "__arrow_c_stream__") or hasattr(recordings, "__arrow_c_array__")
    is_one = is_table or isinstance(recordings, Mapping | str | PathLike)
    return not is_one and isinstance(recordings, Iterable)


def _lines(text: str) -> list[doc.Fault]:
    lines: list[doc.Fault] = json.loads(text)
    return lines


def _asset_text(asset: Asset | None) -> str | None:
    """Returns the JSON text of an asset or a scene."""
    if asset is None:
        return None
    if isinstance(asset, Mapping):
        return json.dumps(dict(asset))
    if isinstance(asset, str) and asset.lstrip().startswith("{"):
        return asset
    with open(asset, encoding="utf-8") as file:
        return file.read()
