"""Makes the files of one small session as other programs write them.

Needs the packages that scripts/formats installs.
"""

import datetime

import duckdb
import openpyxl
import pandas
import polars
import pyarrow
import pyarrow.csv

COLUMNS = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"]

table = pandas.DataFrame(
    [[0.0, 0.1, None, 0.25, -0.5], [0.01, -0.1, 0.2, None, None]], columns=COLUMNS
)
table.insert(0, "seq", [0, 1])
table["note"] = ["kept by", "nobody"]
table.to_parquet("pandas.parquet", index=False)

frame = polars.DataFrame(
    {
        "note": ["kept by", "nobody"],
        "y_m": [-0.5, None],
        "x_m": [0.25, None],
        "seq": [0, 1],
        "cmd_qy_rad": [None, 0.2],
        "cmd_qx_rad": [0.1, -0.1],
        "t_s": [0.0, 0.01],
    }
)
frame.write_parquet("polars.parquet")
frame.drop("note").write_ipc_stream("polars.arrow")

with pyarrow.OSFile("pyarrow-file.arrow", "wb") as sink:
    rows = pyarrow.Table.from_pandas(table.drop(columns="note"), preserve_index=False)
    with pyarrow.ipc.new_file(sink, rows.schema) as writer:
        writer.write_table(rows)

duckdb.sql("COPY (SELECT * FROM frame) TO 'duckdb.parquet' (FORMAT parquet)")


def workbook(name, rows, sheet="Data"):
    """Writes a sheet, and a second one that is not read."""
    book = openpyxl.Workbook()
    book.active.title = sheet
    for row in rows:
        book.active.append(row)
    book.create_sheet("Notes").append(["kept by nobody"])
    book.save(name)


HEADER = ["note", "seq", *COLUMNS]
workbook(
    "openpyxl.xlsx",
    [
        [],
        HEADER,
        ["kept by", 0, 0, 0.1, None, 0.25, -0.5],
        [],
        ["nobody", 1, 0.01, -0.1, "0.2", None, None],
    ],
)
second = datetime.datetime(2026, 3, 1, 12, 0, 0, 250_000)
workbook(
    "dates.xlsx",
    [
        HEADER,
        [None, None, second, 0, 0, 0, 0],
        [None, None, datetime.time(0, 1, 30), 0, 0, 0, 0],
        [None, None, 2, "left", 0, 0, 0],
        [None, None, 3, 0, 0, second, 0],
        [None, None, 4, 0, 0, True, 0],
        [None, 1.5, 5, 0, 0, 0, 0],
        [None, 6, None, 0, 0, 0, 0],
    ],
)
workbook("columns.xlsx", [["t_s", "x_m"], [0, 0]], sheet="Run 1")
