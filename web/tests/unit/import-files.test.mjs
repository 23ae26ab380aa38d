// Files to import: their formats, encodings and decimal separators.
import assert from "node:assert/strict";
import { test } from "node:test";
import { FORMATS, formatError, WRITTEN } from "../../src/api/formats.ts";
import { ProblemError } from "../../src/api/request.ts";
import { fileFormat } from "../../src/pages/import/file-format.ts";
import { guessFactor, guessMapping } from "../../src/pages/import/mapping.ts";
import { readTable } from "../../src/pages/import/table.ts";
import { textOf } from "../../src/pages/import/text-of.ts";
import { likelyUnit } from "../../src/pages/import/time-unit.ts";

const bytes = (text) => Uint8Array.from(text, (letter) => letter.charCodeAt(0));
const format = (head) => fileFormat(bytes(head));

test("the first bytes tell the format, whatever the file is called", () => {
  assert.equal(format("PAR1\x15\x04"), "parquet");
  assert.equal(format("ARROW1\0\0\xff\xff\xff\xff"), "arrow");
  assert.equal(format("\xff\xff\xff\xff\x10\0\0\0"), "arrow");
  assert.equal(format("\x89MCAP0\r\n\x01"), "mcap");
  assert.equal(format("PK\x03\x04\x14\0[Content_Types].xml"), "xlsx");
  for (const text of ["t_s,x_m,y_m\n", "", "PARTS,1", "\xff\xfet\0"]) assert.equal(format(text), "csv", text);
});

test("a spreadsheet that the service does not read is refused with what to do", () => {
  const archive = `PK\x03\x04\x14${"\0".repeat(25)}mimetypeapplication/vnd.oasis.opendocument.spreadsheet`;
  assert.throws(() => format(archive), /OpenDocument.*Excel workbook \(\.xlsx\) or as CSV/);
  assert.throws(() => format("\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"), /old Excel workbook/);
});

test("a file that is no text is refused in words", () => {
  for (const binary of ["\x89PNG\r\n\x1a\n\0", "a,b,c\n1,2,\0\n", "\x7fELF\x02\x01"])
    assert.throws(() => textOf(bytes(binary)), /neither a text nor/, JSON.stringify(binary));
  assert.equal(textOf(bytes("a\tb\r\n\f1\n")), "a\tb\r\n\f1\n");
  assert.equal(textOf(bytes("\xff\xfea\0,\0")), "a,", "UTF-16");
});

test("a time that is 1000 times too slow for the rig is in milliseconds", () => {
  const columns = (step) => ({ t_s: [0, 1, null, 2, 3].map((i) => (i === null ? null : i * step)) });
  assert.deepEqual(likelyUnit(columns(10), 100), { word: "ms", factor: 1e-3, spacing: 10 });
  assert.equal(likelyUnit(columns(10_000), 100).word, "µs");
  for (const step of [0.01, 0.1, 1]) assert.equal(likelyUnit(columns(step), 100), undefined, `${step} s`);
  assert.equal(likelyUnit({ t_s: [1] }, 100), undefined);
});

test("a text that is not UTF-8 is Windows-1252, and its units keep their signs", () => {
  const table = "Zeit [µs];Winkel X [°]\n0;1\n";
  assert.equal(textOf(new TextEncoder().encode(table)), table);
  assert.equal(textOf(bytes(table)), table);
  const wide = new Uint8Array([0xff, 0xfe, ...[...table].flatMap((letter) => [letter.charCodeAt(0), 0])]);
  assert.equal(textOf(wide), table);
  const german = readTable(textOf(bytes("Zeit [µs];Winkel X [°];Kugel X [mm]\n0;1;2\n1;1;2")));
  assert.equal(guessFactor("cmd_qx_rad", german, 1), Math.PI / 180);
  assert.equal(guessFactor("t_s", german, 0), 1e-6);
});

const lines = (...rows) => readTable(rows.map((row) => row.join("\t")).join("\n"));

test("between tabs, commas are decimal separators if no number has a point", () => {
  const { rows } = lines(["t", "x", "y"], ["0,5", "1,25", "-2"], ["1", "", "3,0"]);
  assert.deepEqual(rows, [
    ["0.5", "1.25", "-2"],
    ["1", "", "3.0"],
  ]);
  const thousands = lines(["t", "x", "y"], ["0.5", "1,250", "2"], ["1", "1,250.5", "3"]);
  assert.deepEqual(thousands.rows[0], ["0.5", "1,250", "2"]);
  const preamble = lines(["Version", "1.2"], ["t", "x", "y"], ["0,5", "1,5", "2"], ["1", "2", "3"]);
  assert.deepEqual(preamble.rows[0], ["0.5", "1.5", "2"]);
});

test("decimal commas without names of columns are no separators", () => {
  for (const separator of ["\t", ";"]) {
    const row = (...cells) => cells.join(separator);
    const { header, rows } = readTable([row("0,5", "1,25", "2,5"), row("1,5", "1,5", "2,25")].join("\n"));
    assert.equal(header.length, 3, JSON.stringify(separator));
    assert.deepEqual(rows[0], ["0.5", "1.25", "2.5"]);
  }
});

test("a tab-separated recording with decimal commas has its quantities", () => {
  const names = ["t [ms]", "x [mm]", "y [mm]"];
  const mapping = guessMapping(lines(names, ["0,0", "12,5", "3,5"], ["10,0", "13,5", "4,5"]));
  assert.deepEqual([mapping.t_s.factor, mapping.x_m.factor], [1e-3, 1e-3]);
});

test("a build without a format is told in words, other errors as they are", () => {
  const refused = (status) => new ProblemError(status, { detail: "as the service says" });
  assert.match(formatError(refused(415), "xlsx").message, /built without Excel files.*feature “xlsx”/);
  assert.match(formatError(refused(406), "arrow").message, /built without Arrow files.*feature “parquet”/);
  for (const [error, name] of [
    [refused(400), "xlsx"],
    [refused(415), "csv"],
    [new TypeError("offline"), "mcap"],
  ])
    assert.equal(formatError(error, name), error);
  assert.ok(!WRITTEN.includes("xlsx"), "workbooks are only read");
  assert.equal(new Set(Object.values(FORMATS).map(({ mediaType }) => mediaType)).size, 6);
});
