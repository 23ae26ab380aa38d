"""Judging, calibrating and simulating, compared with the program `offbd`."""

from __future__ import annotations

import csv
import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from conftest import judged_by_program, run_program

import offbd

if TYPE_CHECKING:
    from offbd.documents import Profile

COLUMNS = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"]
EMPTY: dict[str, list[float]] = {name: [] for name in COLUMNS}


def lists(path: Path) -> dict[str, list[float | None]]:
    """Reads a session file with the standard library."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [float(row[name]) if row[name] else None for row in rows] for name in COLUMNS}


def arrays(path: Path) -> dict[str, Any]:
    return {name: np.array(column, dtype=float) for name, column in lists(path).items()}


def any_word(word: str) -> Any:
    return word


class OneBatch:
    """A recording that offers a single record batch, not a stream."""

    def __init__(self, path: Path) -> None:
        self.batch = pa.RecordBatch.from_pydict(lists(path))

    def __arrow_c_array__(self, requested_schema: object = None) -> object:
        return self.batch.__arrow_c_array__(requested_schema)


SOURCES: dict[str, Callable[[Path], Any]] = {
    "lists": lists,
    "numpy": arrays,
    "pandas": pd.read_csv,
    "polars": pl.read_csv,
    "pyarrow": lambda path: pa.table(lists(path)),
    "pyarrow in batches": lambda path: pa.Table.from_batches(
        pa.table(lists(path)).to_batches(max_chunksize=97)
    ),
    "one batch": OneBatch,
}


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("profile", [None, "textbook"])
def test_validate_the_verdict_against_the_program(
    folder: Path, source: str, profile: Profile | None
) -> None:
    session = folder / "sick.csv"
    more = ("--profile", profile) if profile else ()
    lines = judged_by_program(folder / "calibrated.json", session, *more)
    recording = SOURCES[source](session)
    asset = folder / "calibrated.json"
    verdict = offbd.replay(recording, asset, profile=profile, session="sick.csv")
    assert verdict.faults == lines[:-1]
    assert verdict.summary == lines[-1]
    assert len(verdict.hash) == 64
    assert "x_servo" in verdict.confirmed


def test_numbers_of_other_types_are_converted() -> None:
    table = pa.table(offbd.simulate(seconds=20, seq=True).table)
    wanted = offbd.replay(table)
    rounded = {name: table[name].cast(pa.float32()) for name in COLUMNS[1:]}
    narrow = pa.table({"t_s": table["t_s"], "seq": table["seq"].cast(pa.int32()), **rounded})
    again = {name: rounded[name].cast(pa.float64()) for name in COLUMNS[1:]}
    wide = pa.table({"t_s": table["t_s"], "seq": table["seq"], **again})
    assert offbd.replay(narrow).hash == offbd.replay(wide).hash
    assert offbd.replay(narrow).summary["samples"] == wanted.summary["samples"] == len(table)


def test_nan_and_null_are_missing_values() -> None:
    table = pa.table(offbd.simulate(seconds=20, faults=["sensor:dropout=0.3@5"]).table)
    assert table["x_m"].null_count > 100
    with_nan = {name: table[name].to_numpy() for name in COLUMNS}
    assert np.isnan(with_nan["x_m"]).sum() == table["x_m"].null_count
    assert offbd.replay(with_nan).hash == offbd.replay(table).hash


def test_a_sample_that_is_sent_twice_counts_once() -> None:
    table = pa.table(offbd.simulate(seconds=10, seq=True).table)
    twice = table.take(np.repeat(np.arange(len(table)), 2))
    assert offbd.replay(twice).summary["samples"] == len(table)


def test_an_engine_gives_the_verdict_of_a_replay(folder: Path) -> None:
    asset = json.loads((folder / "calibrated.json").read_text())
    frame = pl.read_csv(folder / "sick.csv")
    wanted = offbd.replay(frame, asset)
    engine = offbd.Engine(asset)
    changes = []
    for start in range(0, len(frame), 500):
        changes += engine.add(frame[start : start + 500])
    assert changes and changes == wanted.faults[: len(changes)]
    assert engine.summary()["faults"] == wanted.confirmed
    ended = engine.end()
    assert (ended.faults, ended.summary) == (wanted.faults, wanted.summary)
    with pytest.raises(RuntimeError, match="has ended"):
        engine.add(frame)
    by_sample = offbd.Engine(asset)
    for row in frame.iter_rows():
        by_sample.add_sample(*row)
    assert by_sample.end().summary == wanted.summary


def test_validate_the_simulation_against_the_program(folder: Path) -> None:
    simulation = offbd.simulate(seed=2, faults=["x_servo:dead@20"])
    assert simulation.table.to_pydict() == lists(folder / "sick.csv")
    assert simulation.asset == json.loads((folder / "rig.json").read_text())
    drawn = offbd.simulate(rig_seed=7, seed=3, seconds=5)
    run_program(
        "simulate", "--rig-seed", "7", "--seed", "3", "--seconds", "5", "-o", folder / "7.csv"
    )
    assert drawn.table.to_pydict() == lists(folder / "7.csv")


def without_date(learnt: Any) -> Any:
    return {**learnt, "calibration": {**learnt["calibration"], "made_at": None}}


def test_validate_the_calibration_against_the_program(folder: Path) -> None:
    learnt = offbd.calibrate(folder / "rig.json", [pd.read_csv(folder / "healthy.csv")])
    wanted = json.loads((folder / "calibrated.json").read_text())
    assert without_date(learnt) == without_date(wanted)


def test_validate_a_scene_against_the_program(folder: Path) -> None:
    description = {
        "duration_s": 2,
        "edges": False,
        "qy": [{"sine": {"amplitude_rad": 0.05, "frequency_hz": 0.7}}],
    }
    file = folder / "scene.json"
    file.write_text(json.dumps(description))
    run_program(
        "scene", file, "--model", "rolling", "--method", "rk4", "--step", "0.001", "-o", folder
    )
    run = offbd.scene(description, model="rolling", method="rk4", step_s=0.001)
    assert (run.model, run.method) == ("rolling", "rk4")
    with open(folder / "trajectory.csv", newline="") as trajectory:
        rows = list(csv.DictReader(trajectory))
    columns = run.table.to_pydict()
    assert len(run.table) == len(rows) == 201
    for name, column in columns.items():
        assert column == [float(row[name]) for row in rows], name
    assert offbd.scene(file).model in ("planar", "rolling")


def test_tables_go_to_other_libraries(folder: Path) -> None:
    frame = pd.read_csv(folder / "sick.csv")
    verdict = offbd.replay(frame, folder / "calibrated.json", evidence=True)
    assert verdict.evidence is not None
    wanted = verdict.evidence.to_pydict()
    assert len(wanted["t_s"]) == len(verdict.evidence) > 5000
    assert max(value for value in wanted["x_nats"]) > 13
    assert pa.table(verdict.evidence).to_pydict() == wanted
    assert pl.DataFrame(verdict.evidence).to_dict(as_series=False) == wanted
    frame = pd.DataFrame.from_arrow(verdict.evidence)
    assert frame["x_nats"].tolist() == wanted["x_nats"]
    assert frame["x_residual_m_s2"].isna().sum() == wanted["x_residual_m_s2"].count(None)


def test_other_threads_run_meanwhile(folder: Path) -> None:
    """The thread can only take a turn during `replay` if that releases the interpreter: no
    other instruction of this thread lies between the two readings of the counter."""
    table = pa.table(offbd.simulate(seconds=600).table)
    turns, stop = [0], threading.Event()

    def count() -> None:
        while not stop.is_set():
            turns[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    try:
        before = turns[0]
        offbd.replay(table)
        during = turns[0] - before
    finally:
        stop.set()
        thread.join()
    assert during > 1000


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: offbd.replay({"t_s": [0.0]}), "lacks the column `cmd_qx_rad`; it has `t_s`"),
        (lambda: offbd.replay(EMPTY), "no usable row"),
        (lambda: offbd.replay({**{name: [0.0] for name in COLUMNS}, "y_m": []}), "`y_m`.*1 and 0"),
        (
            lambda: offbd.replay({**{name: [0.0] for name in COLUMNS}, "x_m": ["a"]}),
            "`x_m` has the type Utf8",
        ),
        (
            lambda: offbd.replay({**{n: [0.0] for n in COLUMNS}, "seq": [-1]}),
            "`seq` has -1 in row 0",
        ),
        (
            lambda: offbd.replay({**{n: [0.0] for n in COLUMNS}, "x_m": np.zeros((1, 1))}),
            "`x_m` is neither numbers nor text in one dimension",
        ),
        (lambda: offbd.replay(EMPTY, '{"name":"a","bal":{}}'), "/bal"),
        (lambda: offbd.replay(EMPTY, profile=any_word("best")), "best"),
        (lambda: offbd.calibrate({"name": "a"}, [EMPTY]), "no sample has a position"),
        (lambda: offbd.simulate(preset=any_word("none")), "none"),
        (lambda: offbd.simulate(faults=["x_servo"]), "x_servo"),
        (lambda: offbd.simulate(seconds=float("nan")), "/seconds"),
        (lambda: offbd.scene("{}", sample_s=0.0), "/sample_s"),
        (lambda: offbd.scene("{}", method="rk4"), "need a model"),
    ],
)
def test_what_is_unusable_is_named(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def test_what_is_not_a_table_is_named() -> None:
    with pytest.raises(TypeError, match="not int"):
        offbd.replay(3)


def test_rejected_rows_are_named_with_their_number() -> None:
    table = offbd.simulate(seconds=5).table.to_pydict()
    table["t_s"][10] = None
    table["x_m"][20] = 1e9
    verdict = offbd.replay(table)
    assert [(row.row, row.reason) for row in verdict.rejected] == [
        (11, "t_s is not a finite number"),
        (21, "x_m is 1000000000, beyond ±50"),
    ]
    assert verdict.summary["rejected"] == 2
