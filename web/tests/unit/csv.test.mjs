// Foreign CSV tables, and the session files made from them.
import assert from "node:assert/strict";
import { test } from "node:test";
import { countSeen, toColumns, toCsv } from "../../src/pages/import/columns.ts";
import { guessFactor, guessMapping } from "../../src/pages/import/mapping.ts";
import { readTable } from "../../src/pages/import/table.ts";
import { random } from "./random.mjs";

const read = (...lines) => readTable(lines.join("\n"));

test("a plain table is read, comments and blank lines left out", () => {
  const table = read("# made by hand", "", "t_s,x_m,y_m", "0,1,2", "  ", "# more", "1,,4", "");
  assert.deepEqual(table.header, ["t_s", "x_m", "y_m"]);
  assert.deepEqual(table.rows, [
    ["0", "1", "2"],
    ["1", "", "4"],
  ]);
});

test("the separator is the most frequent one in the first line", () => {
  for (const separator of [",", ";", "\t"]) {
    const table = read(
      ["t", "x", "y"].join(separator),
      ["0", "1", "2"].join(separator),
      ["1", "2", "3"].join(separator),
    );
    assert.deepEqual(table.rows[1], ["1", "2", "3"], JSON.stringify(separator));
  }
});

test("a line of blanks is no row, one of empty cells is", () => {
  assert.equal(read("t\tx\ty", "0\t1\t2", "\t\t", "1\t2\t3").rows.length, 2);
  assert.deepEqual(read("t,x,y", "0,1,2", ",,").rows[1], ["", "", ""]);
});

test("with semicolons, the comma is the decimal separator", () => {
  assert.deepEqual(read("t;x;y", "0,5;1,25;-2", "1;;3,0").rows, [
    ["0.5", "1.25", "-2"],
    ["1", "", "3.0"],
  ]);
});

test("separators within quotes separate nothing", () => {
  assert.deepEqual(read("t;x;y", '"1,5";2;"3,25"', '2;"4,5";1').rows, [
    ["1.5", "2", "3.25"],
    ["2", "4.5", "1"],
  ]);
  assert.deepEqual(read("t,x,y,note", '0,1,2,"left, then right"', "1,2,3,").rows[0], [
    "0",
    "1",
    "2",
    "left, then right",
  ]);
});

test("separators within quoted names do not count for the choice of the separator", () => {
  const { header, rows } = read(
    '"t; in s, not ms; of the device; really";"ball x, y up";y',
    "0;1;2",
    "1;2;3",
  );
  assert.deepEqual(header, ["t; in s, not ms; of the device; really", "ball x, y up", "y"]);
  assert.deepEqual(rows[1], ["1", "2", "3"]);
  assert.deepEqual(read('"a;b;c;d",x,y', "0,1,2", "1,2,3").header, ["a;b;c;d", "x", "y"]);
});

test("quotes are taken off, doubled ones are one, and line breaks within them stay", () => {
  const { header, rows } = read('"t","the ""x""","y\nup"', '0,"1",2', '1,2,"3\n"', '2, "3" ,4');
  assert.deepEqual(header, ["t", 'the "x"', "y\nup"]);
  assert.deepEqual(rows, [
    ["0", "1", "2"],
    ["1", "2", "3"],
    ["2", "3", "4"],
  ]);
});

test("line ends of any system and a byte order mark change nothing", () => {
  const lines = ["t,x,y", '0,1,"2"', "1,2,3"];
  const wanted = readTable(lines.join("\n"));
  for (const end of ["\r\n", "\r"])
    assert.deepEqual(readTable(lines.join(end) + end), wanted, JSON.stringify(end));
  assert.deepEqual(readTable(`\uFEFF${lines.join("\r\n")}`), wanted);
  assert.deepEqual(readTable('\uFEFF"t",x,y\r\n0,1,"2"\n1,2,3\r\n').rows, wanted.rows, "line ends mixed");
});

test("a file that is not a table is refused with a message", () => {
  assert.throws(() => read("t,x", "0,1", "1,2"), /No line has three or more columns/);
  assert.throws(() => read("t,x,y", "0,1,2"), /no rows/);
  assert.throws(() => read(""), /file is empty/);
  assert.throws(() => read("", "  "), /file is empty/);
  assert.throws(() => read("t,x,y", "0,1,2", '1,"2,3', "2,3,4"), /row 3.*quote/i);
});

test("lines before the column names are a preamble", () => {
  const table = read("Recorded by Ada, on the bench", "Rig: 7", "t;x;y", "0,1;1,5;2,5", "0,2;1,6;2,6");
  assert.deepEqual(table.header, ["t", "x", "y"]);
  assert.deepEqual(table.rows[1], ["0.2", "1.6", "2.6"]);
});

test("numbers without names are columns to choose from", () => {
  const table = read("0,1,2", "1,2,3", "2,3,4");
  assert.deepEqual(table.header, ["column 1", "column 2", "column 3"]);
  assert.equal(table.rows.length, 3);
});

test("runs of blanks separate columns if nothing else does", () => {
  const table = read("  t   x  y", "0.0  1 2", " 0.1 2   3 ");
  assert.deepEqual(table.header, ["t", "x", "y"]);
  assert.deepEqual(table.rows, [
    ["0.0", "1", "2"],
    ["0.1", "2", "3"],
  ]);
});

test("a column chosen by hand has the unit of its name", () => {
  const table = read("Zeit [s];Winkel X [°];Kugel X [mm]", "0;1;2", "1;1;2");
  assert.equal(guessFactor("cmd_qx_rad", table, 1), Math.PI / 180);
  assert.equal(guessFactor("x_m", table, 2), 1e-3);
});

test("times that are dates are no times, and such rows are not counted", () => {
  const table = read("t_s,x_m,y_m", "2026-03-01T10:00:00.020,0,0", "2026-03-01T10:00:00.040,0,0");
  const columns = toColumns(table, guessMapping(table));
  assert.deepEqual(columns.t_s, [null, null]);
  assert.equal(countSeen(columns), 0);
});

test("columns and units are recognized by name", () => {
  const mapping = guessMapping(
    read("time [ms];ball x (mm);ball y (mm);qx (deg);qy (deg)", "0;1;2;3;4", "10;1;2;3;4"),
  );
  const index = Object.fromEntries(Object.entries(mapping).map(([role, column]) => [role, column.index]));
  assert.deepEqual(index, { t_s: 0, cmd_qx_rad: 3, cmd_qy_rad: 4, x_m: 1, y_m: 2 });
  assert.deepEqual([mapping.t_s.factor, mapping.x_m.factor], [1e-3, 1e-3]);
  assert.equal(mapping.cmd_qx_rad.factor, Math.PI / 180);
});

test("without a unit in the name, the size of the values decides", () => {
  const mapping = guessMapping(read("t,qx,qy,x,y", "0,5,0,100,3", "10,2,1,50,4", "20,3,1,20,1"));
  assert.deepEqual([mapping.t_s.factor, mapping.x_m.factor, mapping.y_m.factor], [1e-3, 1e-3, 1e-3]);
  const metric = guessMapping(read("t,qx,qy,x,y", "0,0.1,0,0.1,0", "0.01,0.1,0,0.05,0"));
  for (const { factor } of Object.values(metric)) assert.equal(factor, 1);
});

test("cells that are not numbers are missing readings", () => {
  const table = read("t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m", "0,0,0,nan,", "1,0,0,None,lost", "2,0,0,-,0.5");
  const columns = toColumns(table, guessMapping(table));
  assert.deepEqual(columns.x_m, [null, null, null]);
  assert.deepEqual(columns.y_m, [null, null, 0.5]);
});

test("factor and sign are applied; a role without a column has no readings", () => {
  const table = read("t,x,y", "0,1,2", "1,2,-4");
  const mapping = guessMapping(table);
  const columns = toColumns(table, { ...mapping, x_m: { index: 1, factor: 0.001, sign: -1 } });
  assert.deepEqual(columns.x_m, [-0.001, -0.002]);
  assert.deepEqual(columns.cmd_qx_rad, [null, null]);
});

test("a written session file is read back unchanged", () => {
  const next = random(7);
  for (let round = 0; round < 50; round++) {
    const value = (scale) => (next() < 0.1 ? null : Number(((next() - 0.5) * scale).toPrecision(9)));
    const make = (of) => Array.from({ length: 2 + Math.floor(next() * 40) }, of);
    const t_s = make((_, i) => i * 0.01).map((t) => Number(t.toFixed(4)));
    const column = (scale) => t_s.map(() => value(scale));
    const columns = {
      t_s,
      cmd_qx_rad: column(0.4),
      cmd_qy_rad: column(0.4),
      x_m: column(0.3),
      y_m: column(0.3),
    };
    const table = readTable(toCsv(columns));
    const mapping = guessMapping(table);
    for (const { factor, sign } of Object.values(mapping)) assert.deepEqual([factor, sign], [1, 1]);
    assert.deepEqual(toColumns(table, mapping), columns);
  }
});

test("a row without a time is not written", () => {
  const columns = { t_s: [0, null], cmd_qx_rad: [1, 1], cmd_qy_rad: [1, 1], x_m: [1, 1], y_m: [null, 1] };
  assert.equal(toCsv(columns), "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,1,1,1,\n");
});
