"""Compares what offbd and other programs read and write. See scripts/formats."""

import contextlib
import json
import re
import subprocess
import sys
import urllib.request
from csv import DictReader
from pathlib import Path

import duckdb
import jsonschema
import mcap.reader
import mcap.writer
import numpy
import openpyxl
import pandas
import polars
import pyarrow.ipc
import pyarrow.parquet
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf import message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet

PROGRAM, DATA, ROWS = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
COLUMNS = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"]

# Rows of the file with which the memory for the long one is compared: more than a row group of
# Parquet, which is the most that offbd holds of a file.
SHORT_ROWS = 150_000
# What a row of the long file takes if it is held in memory.
ROW_BYTES = 8 * (len(COLUMNS) + 1)
# The share of the further rows that may be in memory: what the system counts differs from run to
# run.
HELD_SHARE = 0.5


def offbd(*arguments, status=0):
    run = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=DATA)
    assert run.returncode == status, f"offbd {arguments}: {run.returncode}\n{run.stderr}"
    return run


def verdict_hash(file):
    lines = offbd("replay", "--asset", "calibrated.json", "--format", "json", file).stdout.splitlines()
    return json.loads(lines[-1])["verdict_hash"]


def bits(frame):
    """The columns as integers of the same bits, and a fixed number for a missing value."""
    found = {}
    for name in COLUMNS:
        values = frame[name]
        doubles = numpy.array([numpy.nan if v is None else v for v in values], dtype="float64")
        found[name] = numpy.where(numpy.isnan(doubles), -1, doubles.view("int64")).tolist()
    return found


def value_bits(value, dtype):
    """A number as an integer of the same bits; truth values and missing ones as they are."""
    if value is None or isinstance(value, bool):
        return value
    return int(numpy.array(value, dtype=dtype).view(f"uint{8 * numpy.dtype(dtype).itemsize}"))


def table_bits(columns):
    """The columns of a trace: times as doubles, other quantities in single precision."""
    dtype = lambda name: "float64" if name == "t_s" else "float32"
    return {name: [value_bits(v, dtype(name)) for v in values] for name, values in columns.items()}


def trace_bits(document):
    """The columns of a trace that is a JSON document."""
    columns = {"t_s": document["t_s"]}
    for axis in ["x", "y"]:
        columns |= {f"{axis}_{name}": values for name, values in document[axis].items()}
    return table_bits(columns | {n: document[n] for n in ["stuck_ball_counter", "sensor_counter"]})


class Api:
    """The interface of a running service."""

    def __init__(self, base):
        self.base = f"{base}/api/v1"

    def ask(self, path, body=None, headers={}):
        request = urllib.request.Request(self.base + path, body, headers)
        with urllib.request.urlopen(request) as answer:
            return answer.read()

    def get(self, path, media_type):
        return self.ask(path, headers={"accept": media_type})

    def imported(self, asset, csv):
        """Registers `asset`, and imports the session `csv`; returns the id of the session."""
        self.ask("/assets", json.dumps(asset).encode(), {"content-type": "application/json"})
        path = f"/assets/{asset['name']}/sessions/import?name=sick.csv"
        return json.loads(self.ask(path, csv, {"content-type": "text/csv"}))["session"]["id"]


@contextlib.contextmanager
def service():
    """A service with an empty store."""
    command = [PROGRAM, "serve", "--data", str(DATA / "store"), "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            for line in process.stderr:
                if found := re.search(r"address=(127\.0\.0\.1:\d+)", re.sub(r"\x1b\[[0-9;]*m", "", line)):
                    yield Api(f"http://{found[1]}")
                    break
        finally:
            process.terminate()


def check(what, found, expected):
    assert found == expected, f"{what} differs"
    print(f"{what}: the same")


offbd("simulate", "--rig", "rig.json", "--reference", "lissajous", "--seconds", 90, "--seed", 7, "-o", "healthy.csv")
offbd("calibrate", "--asset", "rig.json", "healthy.csv", "-o", "calibrated.json")
offbd("simulate", "--seed", 2, "--seconds", 40, "--fault", "x_servo:dead@20", "-o", "sick.csv")
with open(DATA / "sick.csv", newline="") as file:
    rows = [{name: float(row[name]) if row[name] else None for name in COLUMNS} for row in DictReader(file)]
csv = pandas.DataFrame(rows, columns=COLUMNS, dtype="float64")
expected = bits({name: [row[name] for row in rows] for name in COLUMNS})
expected_hash = verdict_hash("sick.csv")
assert -1 in expected["x_m"], "no missing value"

# What offbd writes is read by others.
for suffix in ["parquet", "arrow"]:
    offbd("export", "sick.csv", "--asset", "calibrated.json", "-o", f"sick.{suffix}")
parquet, arrow = DATA / "sick.parquet", DATA / "sick.arrow"
table = pyarrow.parquet.read_table(parquet)
check("Parquet in pyarrow", bits(table.to_pydict()), expected)
types = {name: str(table.schema.field(name).type) for name in [*COLUMNS, "seq"]}
assert types == dict.fromkeys(COLUMNS, "double") | {"seq": "int64"}, types
check("Parquet in polars", bits(polars.read_parquet(parquet).to_dict(as_series=False)), expected)
relation = duckdb.read_parquet(str(parquet))
check("Parquet in DuckDB", bits(relation.to_arrow_table().to_pydict()), expected)
check("Parquet in pandas", bits(pandas.read_parquet(parquet).astype(object)), expected)
with pyarrow.ipc.open_stream(arrow) as reader:
    stream = reader.read_all()
check("Arrow in pyarrow", bits(stream.to_pydict()), expected)
check("Arrow in polars", bits(polars.read_ipc_stream(arrow).to_dict(as_series=False)), expected)
for metadata in [pyarrow.parquet.read_metadata(parquet).metadata, stream.schema.metadata]:
    assert metadata[b"offbd.verdict_hash"].decode() == expected_hash, metadata
    asset = json.loads(metadata[b"offbd.asset_file"])
    assert asset["calibration"]["id"] == metadata[b"offbd.calibration_id"].decode(), metadata
print("metadata: asset file, calibration and verdict hash")

# The trace of the session is the same in each format, and as the service answers in JSON.
for suffix in ["parquet", "arrow"]:
    offbd("export", "sick.csv", "--asset", "calibrated.json", "--trace", f"trace.{suffix}")
with service() as api:
    session = api.imported(json.loads((DATA / "calibrated.json").read_text()), (DATA / "sick.csv").read_bytes())
    document = json.loads(api.get(f"/sessions/{session}/trace?points=20000", "application/json"))
    for media_type, name in [("parquet", "served.parquet"), ("arrow.stream", "served.arrow")]:
        (DATA / name).write_bytes(api.get(f"/sessions/{session}/trace", f"application/vnd.apache.{media_type}"))
traced = trace_bits(document)
assert len(traced["t_s"]) > 500, len(traced["t_s"])
for name in ["trace", "served"]:
    parquet, arrow = DATA / f"{name}.parquet", DATA / f"{name}.arrow"
    found = {
        "Parquet in pyarrow": pyarrow.parquet.read_table(parquet).to_pydict(),
        "Parquet in DuckDB": duckdb.read_parquet(str(parquet)).to_arrow_table().to_pydict(),
        "Parquet in polars": polars.read_parquet(parquet).to_dict(as_series=False),
        "Arrow in pyarrow": pyarrow.ipc.open_stream(arrow.read_bytes()).read_all().to_pydict(),
        "Arrow in polars": polars.read_ipc_stream(arrow).to_dict(as_series=False),
    }
    for what, columns in found.items():
        check(f"{name}: {what}", table_bits(columns), traced)
    metadata = pyarrow.parquet.read_metadata(parquet).metadata
    assert json.loads(metadata[b"offbd.thresholds"]) == document["thresholds"], metadata
    assert metadata[b"offbd.verdict_hash"].decode() == expected_hash, metadata

# Tables of a clock that counts from 1970 have absolute times too, whose statistics each program
# reads; those of the other columns are of an order that pyarrow does not know.
SINCE_1970_S = 1_764_000_000.125
dated = csv.assign(t_s=csv.t_s + SINCE_1970_S)
dated.to_csv(DATA / "dated.csv", index=False)
dated_hash = verdict_hash("dated.csv")
with service() as api:
    asset = json.loads((DATA / "calibrated.json").read_text()) | {"name": "dated"}
    session = api.imported(asset, (DATA / "dated.csv").read_bytes())
    opened_at = json.loads(api.get(f"/sessions/{session}", "application/json"))["opened_at"]
    for path, name in [("telemetry", "served"), ("trace", "served-trace")]:
        for kind, suffix in [("parquet", "parquet"), ("arrow.stream", "arrow")]:
            file = api.get(f"/sessions/{session}/{path}", f"application/vnd.apache.{kind}")
            (DATA / f"{name}-dated.{suffix}").write_bytes(file)
offbd("export", "dated.csv", "-o", "dated.parquet")
offbd("export", "dated.csv", "-o", "dated.arrow")
offbd("export", "dated.csv", "--asset", "calibrated.json", "--trace", "dated-trace.parquet")
for name in ["served-dated", "served-trace-dated", "dated", "dated-trace"]:
    parquet, arrow = DATA / f"{name}.parquet", DATA / f"{name}.arrow"
    tables = {"Parquet": pyarrow.parquet.read_table(parquet)}
    if arrow.exists():
        tables["Arrow"] = pyarrow.ipc.open_stream(arrow.read_bytes()).read_all()
    for what, found in tables.items():
        assert str(found.schema.field("time").type) == "timestamp[us, tz=UTC]", found.schema
        micros = [round(t_s * 1e6) for t_s in found["t_s"].to_pylist()]
        check(f"{name}: times in {what}", found["time"].cast("int64").to_pylist(), micros)
        opened = opened_at.encode() if name.startswith("served") else None
        assert found.schema.metadata.get(b"offbd.opened_at") == opened, found.schema.metadata
    first, last = min(micros), max(micros)
    column = next(c for c in (lambda m: map(m.column, range(m.num_columns)))(
        pyarrow.parquet.read_metadata(parquet).row_group(0)) if c.path_in_schema == "time")
    bounds = [round(t.timestamp() * 1e6) for t in (column.statistics.min, column.statistics.max)]
    check(f"{name}: statistics of `time` in pyarrow", bounds, [first, last])
    (bounds,) = duckdb.sql(f"""SELECT stats_min_value::DOUBLE, stats_max_value::DOUBLE
        FROM parquet_metadata('{parquet}') WHERE path_in_schema = 't_s'""").fetchall()
    t_s = tables["Parquet"]["t_s"].to_pylist()
    check(f"{name}: statistics of `t_s` in DuckDB", bounds, (min(t_s), max(t_s)))
for name in ["dated.parquet", "dated.arrow", "served-dated.parquet", "served-dated.arrow"]:
    check(name, verdict_hash(name), dated_hash)
offbd("export", "dated.csv", "-o", "dated.mcap")
with open(DATA / "dated.mcap", "rb") as file:
    times = [message.log_time for _, _, message in mcap.reader.make_reader(file).iter_messages()]
check("times in MCAP", times, [round(t_s * 1e9) for t_s in dated.t_s])
assert "time" not in table.schema.names, "a clock that does not count from 1970"

# An MCAP file has the samples. Messages in JSON are as their schemas say; those of Foxglove are
# read with its own types and, like any program does, with those that the file describes.
FOXGLOVE = {f"foxglove.{kind.DESCRIPTOR.name}": kind for kind in (FrameTransforms, Log, SceneUpdate)}


def described_type(schema):
    """The message type that the file itself describes."""
    files = FileDescriptorSet.FromString(schema.data)
    return message_factory.GetMessages(files.file)[schema.name]


offbd("export", "sick.csv", "--asset", "calibrated.json", "-o", "sick.mcap")
messages = {}
with open(DATA / "sick.mcap", "rb") as file:
    reader = mcap.reader.make_reader(file, validate_crcs=True)
    metadata = {record.name: record.metadata for record in reader.iter_metadata()}["offbd"]
    (attachment,) = reader.iter_attachments()
    validators, types = {}, {}
    for schema, channel, message in reader.iter_messages():
        of_topic = messages.setdefault((channel.topic, schema.name), [])
        if schema.name in FOXGLOVE:
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf"), channel
            content = FOXGLOVE[schema.name].FromString(message.data)
            if schema.id not in types:
                types[schema.id] = described_type(schema)
            described = types[schema.id].FromString(message.data)
            assert str(described) == str(content), schema.name
        else:
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json"), channel
            content = json.loads(message.data)
            if schema.id not in validators:
                document = json.loads(schema.data)
                jsonschema.Draft202012Validator.check_schema(document)
                validators[schema.id] = jsonschema.Draft202012Validator(document)
            # One in fifty of each topic, for the time that it takes.
            if len(of_topic) % 50 == 0:
                validators[schema.id].validate(content)
        of_topic.append(content)
    counts = reader.get_summary().statistics.channel_message_counts
    assert sum(counts.values()) == sum(map(len, messages.values())), counts
samples = messages["/offbd/samples", "offbd.Sample"]
check("MCAP in mcap", bits({name: [sample[name] for sample in samples] for name in COLUMNS}), expected)
topics = {("/rig", "foxglove.SceneUpdate"), ("/twin", "foxglove.SceneUpdate"), ("/tf", "foxglove.FrameTransforms")}
assert topics <= messages.keys(), messages.keys()
lines = map(json.loads, offbd("replay", "--asset", "calibrated.json", "--format", "json", "sick.csv").stdout.splitlines())
replayed = [line["summary"] for line in lines if "verdict_hash" not in line]
check("the faults in the log", [log.message for log in messages["/faults", "foxglove.Log"]], replayed)
assert replayed, "no fault"
assert metadata["offbd.verdict_hash"] == expected_hash, metadata
assert json.loads(attachment.data)["calibration"]["id"] == metadata["offbd.calibration_id"], metadata
check("MCAP in offbd", verdict_hash("sick.mcap"), expected_hash)


def write_mcap(file, compression):
    """The samples as messages of a topic of another program, between other messages."""
    writer = mcap.writer.Writer(file, compression=compression)
    writer.start()
    schema = writer.register_schema(name="offbd.Sample", encoding="jsonschema", data=b"{}")
    channel = writer.register_channel(topic="/lab/rig", message_encoding="json", schema_id=schema)
    other = writer.register_channel(topic="/lab/note", message_encoding="text", schema_id=0)
    for row in rows:
        times = {"log_time": int(row["t_s"] * 1e9), "publish_time": 0}
        writer.add_message(channel_id=channel, data=json.dumps(row).encode(), **times)
        writer.add_message(channel_id=other, data=b"kept by nobody", **times)
    writer.finish()


for compression in [mcap.writer.CompressionType.NONE, mcap.writer.CompressionType.ZSTD]:
    write_mcap(str(DATA / "other.mcap"), compression)
    check(f"MCAP of mcap, {compression.name}", verdict_hash("other.mcap"), expected_hash)

# What others write is judged the same.
frame = polars.from_pandas(csv)
files = {
    "pandas.parquet": lambda f: csv.to_parquet(f, index=False),
    "pandas-zstd.parquet": lambda f: csv.to_parquet(f, index=False, compression="zstd"),
    "polars.parquet": frame.write_parquet,
    "polars-stream.arrow": frame.write_ipc_stream,
    "duckdb.parquet": lambda f: duckdb.sql(f"COPY frame TO '{f}' (FORMAT parquet)"),
    "rows-of-ten.parquet": lambda f: csv.to_parquet(f, index=False, row_group_size=10),
    "feather.arrow": lambda f: csv.to_feather(f, compression="uncompressed"),
    "more-columns.parquet": lambda f: csv.assign(note="x", n=1)[
        ["note", *reversed(COLUMNS), "n"]
    ].to_parquet(f, index=False),
    "texts.parquet": lambda f: csv.assign(
        **{name: csv[name].map(repr).replace("nan", None) for name in ("cmd_qx_rad", "x_m")}
    ).to_parquet(f, index=False),
}
for name, write in files.items():
    write(DATA / name)
    check(name, verdict_hash(name), expected_hash)

book = openpyxl.Workbook()
book.active.append(COLUMNS)
for row in rows:
    book.active.append([row[name] for name in COLUMNS])
book.save(DATA / "openpyxl.xlsx")
check("Excel of openpyxl", verdict_hash("openpyxl.xlsx"), expected_hash)

# Errors name what is wrong.
refused = {
    "missing.parquet": (csv.drop(columns=["x_m", "y_m"]), "`x_m`"),
    "truth.parquet": (csv.assign(cmd_qx_rad=True), "`cmd_qx_rad`"),
}
for name, (wrong, word) in refused.items():
    wrong.to_parquet(DATA / name, index=False)
    error = offbd("replay", name, status=3).stderr
    assert word in error, f"{name}: {error}"
csv.to_feather(DATA / "compressed.arrow", compression="lz4")
error = offbd("replay", "compressed.arrow", status=3).stderr
assert "compress" in error, error
print("wrong columns and compressed Arrow files: refused by name")

frame.write_ipc(DATA / "polars-file.arrow", compression="uncompressed")
error = offbd("replay", "polars-file.arrow", status=3).stderr
assert "as an Arrow stream" in error, error

# Runs a program and prints the most memory that it took, KiB. The system counts what its parent
# had at its start too, so that the parent must be small, unlike this program.
MEASURE = """import os, sys
process = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
_, status, usage = os.wait4(process, 0)
print(usage.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status))
"""


def peak_bytes(*arguments):
    """Runs offbd; returns the most memory that it took."""
    command = [sys.executable, "-c", MEASURE, PROGRAM, *map(str, arguments)]
    return int(subprocess.run(command, check=True, stdout=subprocess.PIPE, cwd=DATA).stdout) << 10


def converted(n_rows):
    """Converts a session of so many rows to Arrow and back; returns the most memory that it took."""
    n = numpy.arange(n_rows)
    made = pandas.DataFrame({"seq": n, "t_s": n * 0.01})
    for i, name in enumerate(COLUMNS[1:]):
        made[name] = numpy.sin(n * 0.001 * (i + 1)) * 0.1
    # One row group, which offbd must not read as a whole.
    made.to_parquet(DATA / "made.parquet", index=False, row_group_size=n_rows)
    steps = [("made.parquet", "made.arrow"), ("made.arrow", "back.parquet")]
    most = max(peak_bytes("export", source, "-o", target) for source, target in steps)
    assert polars.read_parquet(DATA / "back.parquet").equals(
        polars.from_pandas(made).select(["t_s", "seq", *COLUMNS[1:]])
    ), f"the session of {n_rows} rows differs"
    return most


# A long session, in bounded memory, in both directions.
assert ROWS >= 2 * SHORT_ROWS, f"{ROWS} rows cannot show it"
short, long = converted(SHORT_ROWS), converted(ROWS)
limit = short + HELD_SHARE * ROW_BYTES * (ROWS - SHORT_ROWS)
assert long < limit, f"{long >> 20} MiB; {short >> 20} MiB for {SHORT_ROWS} rows"
print(f"{ROWS} rows to Arrow and back: the same, with {long >> 20} MiB, {short >> 20} MiB for {SHORT_ROWS}")
