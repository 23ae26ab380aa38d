"""Recordings in files, compared with the program `offbd`."""

from __future__ import annotations

import csv
import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet
import pytest
from conftest import PROGRAM, judged_by_program, run_program
from test_engine import lists, without_date

import offbd


def with_other_columns(folder: Path, name: str) -> Path:
    """Writes the recording in ms and mm, with other names and semicolons."""
    file = folder / f"other-{name}"
    rows = pd.read_csv(folder / name)
    renamed = pd.DataFrame(
        {
            "time": rows["t_s"] * 1000.0,
            "qx": rows["cmd_qx_rad"],
            "qy": rows["cmd_qy_rad"],
            "ball_x": rows["x_m"] * 1000.0,
            "ball_y": rows["y_m"] * 1000.0,
        }
    )
    renamed.to_csv(file, sep=";", index=False)
    return file


MAPPING = "t_s=time/ms, cmd_qx_rad=qx, cmd_qy_rad=qy, x_m=ball_x/mm, y_m=ball_y/mm"


def converted(folder: Path, kind: str) -> Path:
    """Writes sick.csv as a file of another kind."""
    file = folder / f"sick.{kind}"
    table = pa.table(lists(folder / "sick.csv"))
    if kind == "parquet":
        pyarrow.parquet.write_table(table, file)
    elif kind == "arrow":
        with pa.ipc.new_stream(file, table.schema) as stream:
            stream.write_table(table)
    else:
        assert kind == "json"
        file.write_text(json.dumps(table.to_pylist()))
    return file


@pytest.mark.parametrize("kind", ["csv", "parquet", "arrow", "json"])
def test_validate_the_verdict_of_a_file_against_the_program(folder: Path, kind: str) -> None:
    file = folder / "sick.csv" if kind == "csv" else converted(folder, kind)
    lines = judged_by_program(folder / "calibrated.json", file)
    for path in (file, str(file)):
        verdict = offbd.replay(path, folder / "calibrated.json")
        assert (verdict.faults, verdict.summary) == (lines[:-1], lines[-1])
    assert verdict.summary["session"] == file.name
    assert offbd.replay(file, session="monday").summary["session"] == "monday"
    engine = offbd.Engine(folder / "calibrated.json")
    assert engine.add(file) and engine.end().hash == verdict.hash


def test_a_mapping_of_columns_is_an_argument_or_part_of_the_asset(folder: Path) -> None:
    file = with_other_columns(folder, "sick.csv")
    with pytest.raises(ValueError, match=f"{file.name}: .*lacks the column"):
        offbd.replay(file)
    asset = folder / "calibrated.json"
    lines = judged_by_program(asset, file, "--columns", MAPPING)
    assert offbd.replay(file, asset, columns=MAPPING).summary == lines[-1]
    own = {**json.loads(asset.read_text()), "columns": MAPPING}
    assert offbd.replay(file, own).summary == lines[-1]
    engine = offbd.Engine(own)
    engine.add(file)
    assert engine.end().hash == lines[-1]["verdict_hash"]
    (table,) = offbd.read(file, own)
    assert len(table) == len(pd.read_csv(file, sep=";"))
    with pytest.raises(ValueError, match="rate_hz: expected a number"):
        offbd.replay(file, rate_hz=0.0)


NAMES = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"]
HEADER = ",".join(NAMES)
OWN_NAMES = "Zeit,Roll,Pitch,X,Y"
OWN = "t_s=Zeit, cmd_qx_rad=Roll, cmd_qy_rad=Pitch, x_m=X, y_m=Y"
COUNTS = "t_s=#1/ms, cmd_qx_rad=#2*1e-5, cmd_qy_rad=#3*1e-5, x_m=#4*1e-6, y_m=#5*1e-6"


def layouts(rows: list[dict[str, float | None]]) -> dict[str, tuple[bytes, str]]:
    """The recording as many programs write it, each with the mapping that it needs."""

    def lines(header: str, join: str = ",", missing: str = "", comma: str = ".") -> str:
        def cell(value: float | None) -> str:
            return missing if value is None else repr(value).replace(".", comma)

        body = [join.join(cell(row[name]) for name in NAMES) for row in rows]
        return "\n".join(([header] if header else []) + body) + "\n"

    def labelled(row: dict[str, float | None]) -> str:
        return " ".join(f"{name}:{'nan' if v is None else v}" for name, v in row.items())

    def counted(row: dict[str, float | None]) -> str:
        factors = zip(row.values(), (1e3, 1e5, 1e5, 1e6, 1e6), strict=True)
        return ",".join("NA" if v is None else str(round(v * factor)) for v, factor in factors)

    plain = lines(HEADER)
    columns = {name: [row[name] for row in rows] for name in NAMES}
    texts = {
        "a spreadsheet": (lines(HEADER.replace(",", ";"), ";", comma=","), ""),
        "missing as nan": (lines(HEADER, missing="nan"), ""),
        "comments": ("% a log\n% of Monday\n\n" + plain.replace("\n0.5,", "\n% half\n0.5,"), ""),
        "NumPy": ("# " + lines(HEADER.replace(",", " "), " ", "nan"), ""),
        "separators at the end": (plain.replace("\n", ",\n").replace(",\n", "\n", 1), ""),
        "carriage returns": (plain.replace("\n", "\r"), ""),
        "a header twice": (f"{HEADER}\n{plain}", ""),
        "units": (f"{HEADER}\ns,rad,rad,m,m\n{lines('')}", ""),
        "own names": (lines(OWN_NAMES), OWN),
        "names before values": ("\n".join(map(labelled, rows)), ""),
        "counts of a microcontroller": ("\n".join(map(counted, rows)), COUNTS),
        "JSON rows": (json.dumps(rows), ""),
        "JSON columns": (json.dumps(columns), ""),
        "JSON lines": ("\n".join(map(json.dumps, rows)), ""),
    }
    files = {name: (text.encode(), mapping) for name, (text, mapping) in texts.items()}
    files["UTF-16"] = (lines(HEADER.replace(",", "\t"), "\t").encode("utf-16"), "")
    return files


def test_validate_the_verdict_of_any_layout_against_the_program(folder: Path) -> None:
    asset = folder / "calibrated.json"
    plain = judged_by_program(asset, folder / "sick.csv")[-1]
    (table,) = offbd.read(folder / "sick.csv")
    n_rows = len(table)
    for name, (content, mapping) in layouts(list(offbd.rows(table))).items():
        file = folder / "layout.txt"
        file.write_bytes(content)
        more = ("--columns", mapping) if mapping else ()
        summary = judged_by_program(asset, file, *more)[-1]
        verdict = offbd.replay(file, asset, columns=mapping or None)
        assert verdict.summary == summary and verdict.confirmed == ["x_servo"], name
        assert (verdict.summary["samples"], verdict.rejected) == (n_rows, []), name
        if mapping != COUNTS:  # whose values are rounded
            assert verdict.hash == plain["verdict_hash"], name


def tables(file: Path) -> dict[str, Any]:
    """The rows of a file with semicolons, as tables of other libraries and as columns."""
    frame = pd.read_csv(file, sep=";")
    return {
        "pandas": frame,
        "polars": pl.from_pandas(frame),
        "pyarrow": pa.Table.from_pandas(frame),
        "batch": pa.RecordBatch.from_pandas(frame),
        "arrays": {name: frame[name].to_numpy() for name in frame.columns},
        "lists": {**frame.to_dict("list"), "notes": object(), "picture": np.zeros((2, 2))},
    }


def test_a_table_has_a_mapping_as_a_file_has(folder: Path) -> None:
    file = with_other_columns(folder, "sick.csv")
    asset = folder / "calibrated.json"
    own = {**json.loads(asset.read_text()), "columns": MAPPING}
    wanted = judged_by_program(asset, file, "--columns", MAPPING)[-1]
    for name, table in tables(file).items():
        verdict = offbd.replay(table, asset, columns=MAPPING)
        assert verdict.hash == offbd.replay(table, own).hash == wanted["verdict_hash"], name
        assert verdict.summary["session"] == "session"
        with pytest.raises(ValueError, match="lacks the column `t_s`; it has `time`"):
            offbd.replay(table, asset)
    healthy = with_other_columns(folder, "healthy.csv")
    learnt = without_date(offbd.calibrate(folder / "rig.json", healthy, columns=MAPPING))
    frame = tables(healthy)["pandas"]
    again = without_date(offbd.calibrate(folder / "rig.json", frame, columns=MAPPING))
    for calibration in (learnt["calibration"], again["calibration"]):
        del calibration["data_sha256"], calibration["id"]  # of the bytes of the file
    assert again == learnt


def test_a_table_of_dates_degrees_and_one_axis_is_read(folder: Path) -> None:
    rows = pd.read_csv(folder / "sick.csv")
    start = pd.Timestamp("2026-02-20T13:51:00+01:00")
    frame = pd.DataFrame(
        {
            "when": start + pd.to_timedelta(rows["t_s"], unit="s"),
            "servo": np.degrees(rows["cmd_qy_rad"]),
            "ball": rows["x_m"] * 100.0,
        }
    )
    file = folder / "beam.csv"
    frame.to_csv(file, index=False)
    mapping = "t_s=when, cmd_qy_rad=servo/deg, x_m=ball/cm"
    wanted = judged_by_program(folder / "rig.json", file, "--columns", mapping)[-1]
    texts = {"when": [str(when) for when in frame["when"]], **frame.drop(columns="when")}
    for table in (frame, texts):
        verdict = offbd.replay(table, folder / "rig.json", columns=mapping)
        assert verdict.hash == wanted["verdict_hash"]
    rate = frame.drop(columns="when")
    (table,) = offbd.read(rate, columns="cmd_qy_rad=servo/deg, x_m=ball/cm", rate_hz=100.0)
    assert table.to_pydict()["t_s"][:3] == [0.0, 0.01, 0.02]
    assert set(table.to_pydict()["y_m"]) == {None}


def test_the_runs_of_a_table_are_sessions(folder: Path) -> None:
    frame = pd.read_csv(folder / "healthy.csv").rename(columns={"t_s": "time"})
    both = pd.concat([frame, frame])
    with pytest.raises(ValueError, match="the recording: the clock starts again at row"):
        offbd.replay(both, columns="t_s=time")
    runs = offbd.read(both, columns="t_s=time")
    assert [run.to_pydict() for run in runs] == [lists(folder / "healthy.csv")] * 2


def test_a_text_without_a_time_has_a_rate(folder: Path) -> None:
    file = folder / "untimed.csv"
    pd.read_csv(folder / "sick.csv").drop(columns="t_s").to_csv(file, index=False)
    lines = judged_by_program(folder / "calibrated.json", file, "--rate", "200")
    verdict = offbd.replay(file, folder / "calibrated.json", rate_hz=200.0)
    assert (verdict.faults, verdict.summary) == (lines[:-1], lines[-1])


@pytest.mark.parametrize("as_list", [False, True])
def test_validate_the_calibration_of_a_file_against_the_program(
    folder: Path, as_list: bool
) -> None:
    file = with_other_columns(folder, "healthy.csv")
    output = folder / "other.json"
    mapping = ("--columns", MAPPING)
    run_program("calibrate", "--asset", folder / "rig.json", file, "-o", output, *mapping)
    source = [file] if as_list else file
    learnt = offbd.calibrate(folder / "rig.json", source, columns=MAPPING)
    assert without_date(learnt) == without_date(json.loads(output.read_text()))


def test_one_table_is_a_list_of_one(folder: Path) -> None:
    frame = pd.read_csv(folder / "healthy.csv")
    wanted = without_date(json.loads((folder / "calibrated.json").read_text()))
    for one in (frame, lists(folder / "healthy.csv"), pa.table(lists(folder / "healthy.csv"))):
        assert without_date(offbd.calibrate(folder / "rig.json", one)) == wanted
    again = offbd.calibrate(folder / "rig.json", (one for one in [frame]))
    assert without_date(again) == wanted
    with pytest.raises(TypeError, match="not int"):
        offbd.calibrate(folder / "rig.json", [3])
    with pytest.raises(TypeError, match="not int"):
        offbd.calibrate(folder / "rig.json", 3)


def twice(folder: Path) -> Path:
    """A file of two runs: its clock starts again."""
    file = folder / "twice.csv"
    header, *rows = (folder / "healthy.csv").read_text().splitlines(keepends=True)
    file.write_text("".join([header, *rows, *rows]))
    return file


def test_the_runs_of_a_file_are_sessions(folder: Path) -> None:
    file = twice(folder)
    n_rows = len(pd.read_csv(folder / "healthy.csv"))
    place = f"twice.csv: the clock starts again at line {n_rows + 2}, .*offbd.read"
    with pytest.raises(ValueError, match=place):
        offbd.replay(file)
    tables = offbd.read(file)
    assert [table.to_pydict() for table in tables] == [lists(folder / "healthy.csv")] * 2
    hashes = [line["verdict_hash"] for line in judged_by_program(folder / "rig.json", file)]
    assert [offbd.replay(table, folder / "rig.json").hash for table in tables] == hashes
    output = folder / "twice.json"
    run_program("calibrate", "--asset", folder / "rig.json", file, "-o", output)
    learnt = offbd.calibrate(folder / "rig.json", file)
    assert without_date(learnt) == without_date(json.loads(output.read_text()))


def test_rejected_rows_of_a_file_are_named_with_their_line(folder: Path) -> None:
    file = folder / "bad.csv"
    rows = (folder / "healthy.csv").read_text().splitlines(keepends=True)
    rows[10] = "x,0,0,0,0\n"
    file.write_text("".join(rows))
    verdict = offbd.replay(file)
    assert [row.row for row in verdict.rejected] == [11]
    told = f"bad.csv: 1 rows rejected, the first: line 11: {verdict.rejected[0].reason}"
    with pytest.warns(UserWarning, match="bad.csv: 1 rows rejected") as warned:
        (table,) = offbd.read(file)
    assert str(warned[0].message).endswith(told) and len(table) == len(rows) - 2
    assert warned[0].filename == __file__
    with pytest.warns(UserWarning, match="line 11"):
        offbd.calibrate(folder / "rig.json", file)


def test_numbered_samples_keep_their_numbers(folder: Path) -> None:
    table = offbd.simulate(seconds=2, seq=True).table
    file = folder / "numbered.csv"
    with open(file, "w", newline="") as out:
        writer = csv.DictWriter(out, table.column_names)
        writer.writeheader()
        writer.writerows(offbd.rows(table))
    (read,) = offbd.read(file)
    assert read.to_pydict() == table.to_pydict()


def test_a_file_that_is_not_a_recording_is_named(folder: Path) -> None:
    (folder / "empty.csv").write_text("")
    (folder / "cut.parquet").write_bytes(converted(folder, "parquet").read_bytes()[:-9])
    (folder / "picture.csv").write_bytes(b"\x89PNG\r\n\x1a\n")
    calls: list[Any] = [offbd.replay, offbd.read, lambda f: offbd.calibrate({"name": "a"}, [f])]
    for call in calls:
        with pytest.raises(FileNotFoundError, match=r"none\.csv"):
            call(folder / "none.csv")
        with pytest.raises(IsADirectoryError, match=folder.name):
            call(folder)
        for name in ("empty.csv", "cut.parquet", "picture.csv"):
            with pytest.raises(ValueError, match=name):
                call(folder / name)
    done = subprocess.run([PROGRAM, "replay", folder / "picture.csv"], capture_output=True)
    with pytest.raises(ValueError) as refusal:
        offbd.replay(folder / "picture.csv")
    assert str(refusal.value) in done.stderr.decode()
