/**
 * A recording of anybody's making: which column is what, in which unit, which way
 * round; turned into the session file that the service takes.
 */

import Papa from "papaparse";

export const ROLES = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"] as const;
export type Role = (typeof ROLES)[number];

export const ROLE_WORDS: Record<Role, string> = {
  t_s: "Time",
  cmd_qx_rad: "Command qx (about x)",
  cmd_qy_rad: "Command qy (about y)",
  x_m: "Ball x",
  y_m: "Ball y",
};

export interface Unit {
  word: string;
  factor: number;
}

const TIME: Unit[] = [
  { word: "s", factor: 1 },
  { word: "ms", factor: 1e-3 },
  { word: "µs", factor: 1e-6 },
];
const ANGLE: Unit[] = [
  { word: "rad", factor: 1 },
  { word: "°", factor: Math.PI / 180 },
  { word: "mrad", factor: 1e-3 },
];
const LENGTH: Unit[] = [
  { word: "m", factor: 1 },
  { word: "mm", factor: 1e-3 },
  { word: "cm", factor: 1e-2 },
  { word: "in", factor: 0.0254 },
];

export const UNITS: Record<Role, Unit[]> = {
  t_s: TIME,
  cmd_qx_rad: ANGLE,
  cmd_qy_rad: ANGLE,
  x_m: LENGTH,
  y_m: LENGTH,
};

export interface Table {
  header: string[];
  rows: string[][];
}

export interface Column {
  index: number | null;
  factor: number;
  sign: 1 | -1;
}

export type Mapping = Record<Role, Column>;

const SEPARATORS = [",", ";", "\t"];

/** Lines among which the first with names is looked for: blank ones may stand before it. */
const HEAD_LINES = 50;

/** The rows of `text`, without comments and blank lines; at most `most` lines of it if given. */
function parse(text: string, delimiter: string, most = 0): string[][] {
  const { data, errors } = Papa.parse<string[]>(text, {
    delimiter,
    newline: "\n",
    comments: "#",
    preview: most,
  });
  const open = most ? undefined : errors.find(({ code }) => code === "MissingQuotes");
  if (open) throw new Error(`In row ${(open.row ?? 0) + 1} a quote is opened that is never closed.`);
  return data.filter((row) => row.join(delimiter).trim() !== "");
}

/** Splits by the separator that the first line has most of; those within quotes do not count. */
export function readTable(file: string): Table {
  const text = file.replace(/^\uFEFF/, "").replace(/\r\n?/g, "\n");
  const nFirst = (delimiter: string) => parse(text, delimiter, HEAD_LINES)[0]?.length ?? 0;
  const separator = SEPARATORS.reduce((best, each) => (nFirst(each) > nFirst(best) ? each : best));
  // Quotes that stand behind a blank are none to the parser.
  const cells = (row: string[]) => row.map((cell) => cell.trim().replace(/^"(.*)"$/s, "$1"));
  const [first = [], ...rows] = parse(text, separator);
  const header = cells(first);
  if (header.length < 3)
    throw new Error(
      "The first line names fewer than three columns; it should name them all, as in t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m.",
    );
  if (header.every((name) => name !== "" && Number.isFinite(Number(name))))
    throw new Error("The first line has numbers; it should have the names of the columns.");
  if (rows.length < 2) throw new Error("There are no rows below the first line.");
  const decimal = separator === ";";
  const plain = (row: string[]) => (decimal ? cells(row).map((cell) => cell.replace(",", ".")) : cells(row));
  return { header, rows: rows.map(plain) };
}

const GUESS: Record<Role, RegExp[]> = {
  t_s: [/^t_s$/i, /^(t|time|timestamp|zeit)([_ ([].*)?$/i, /time|stamp|seconds|millis/i],
  cmd_qx_rad: [/^cmd_qx_rad$/i, /qx|cmd.*x$|tilt.*x|alpha|roll|servo.*y/i],
  cmd_qy_rad: [/^cmd_qy_rad$/i, /qy|cmd.*y$|tilt.*y|beta|pitch|servo.*x/i],
  x_m: [/^x_m$/i, /^(ball|pos|meas)?[_ ]?x([_ ([](m|mm|cm|in|px).*)?$/i, /(ball|pos).*x/i],
  y_m: [/^y_m$/i, /^(ball|pos|meas)?[_ ]?y([_ ([](m|mm|cm|in|px).*)?$/i, /(ball|pos).*y/i],
};

function unitByName(role: Role, name: string): Unit | undefined {
  const suffix = name.toLowerCase().match(/(?:[_ ([])(s|ms|us|µs|rad|mrad|deg|°|m|mm|cm|in)[)\]]?$/)?.[1];
  const word = { deg: "°", us: "µs" }[suffix ?? ""] ?? suffix;
  return UNITS[role].find((unit) => unit.word === word);
}

/** The unit that the sizes of the numbers suggest. */
function unitBySize(role: Role, largest: number, step: number): Unit {
  const units = UNITS[role];
  if (role === "t_s") return units[step > 2000 ? 2 : step > 1.5 ? 1 : 0]!;
  if (role === "x_m" || role === "y_m") return units[largest > 2 ? 1 : 0]!;
  return units[largest > 1.6 ? 1 : 0]!;
}

export function guess(table: Table): Mapping {
  const taken = new Set<number>();
  const mapping = {} as Mapping;
  for (const role of ROLES) {
    const index =
      GUESS[role]
        .map((pattern) => table.header.findIndex((name, i) => !taken.has(i) && pattern.test(name)))
        .find((i) => i >= 0) ?? null;
    if (index !== null) taken.add(index);
    const values =
      index === null
        ? []
        : numbers(table, index)
            .slice(0, 5000)
            .filter((n): n is number => n !== null);
    const largest = values.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
    const steps = values
      .slice(1, 200)
      .map((value, i) => value - values[i]!)
      .sort((a, b) => a - b);
    const unit =
      (index !== null && unitByName(role, table.header[index]!)) ||
      unitBySize(role, largest, steps[steps.length >> 1] ?? 0);
    mapping[role] = { index, factor: unit.factor, sign: 1 };
  }
  return mapping;
}

function numbers(table: Table, index: number): (number | null)[] {
  return table.rows.map((row) => {
    const cell = row[index];
    if (cell === undefined || cell === "" || /^(nan|null|none|na|-)$/i.test(cell)) return null;
    const value = Number(cell);
    return Number.isFinite(value) ? value : null;
  });
}

export type Columns = Record<Role, (number | null)[]>;

export function apply(table: Table, mapping: Mapping): Columns {
  const columns = {} as Columns;
  for (const role of ROLES) {
    const { index, factor, sign } = mapping[role];
    columns[role] =
      index === null
        ? table.rows.map(() => null)
        : numbers(table, index).map((value) => (value === null ? null : value * factor * sign));
  }
  return columns;
}

export function toCsv(columns: Columns): string {
  const cell = (value: number | null | undefined) =>
    value == null ? "" : `${Number(value.toPrecision(12))}`;
  const lines = columns.t_s.map((t, i) =>
    t === null ? "" : ROLES.map((role) => cell(columns[role][i])).join(","),
  );
  return `${ROLES.join(",")}\n${lines.filter(Boolean).join("\n")}\n`;
}

export interface SignCheck {
  /** Correlation of the ball's acceleration along x and y with the two slopes. */
  x: { own: number; other: number };
  y: { own: number; other: number };
  moments: number;
}

/** Half of the window over which a curve is fitted, s. */
const HALF_S = 0.3;

/**
 * Does the ball go where the plate tilts? +qy moves it toward +x, +qx toward −y.
 * The ball's curvature over a short window is compared with both commands over
 * the same window, a servo's delay later.
 */
export function checkSigns(columns: Columns): SignCheck {
  const { t_s: t } = columns;
  const n = t.length;
  const ax: number[] = [],
    ay: number[] = [],
    ux: number[] = [],
    uy: number[] = [];
  const period = n > 1 ? ((t[n - 1] ?? 0) - (t[0] ?? 0)) / (n - 1) : 0.01;
  const half = Math.max(Math.round(HALF_S / Math.max(period, 1e-4)), 3);
  const delay = Math.round(0.08 / Math.max(period, 1e-4));
  for (let i = half + delay; i + half < n; i += Math.max(half >> 1, 1)) {
    const x = curvature(t, columns.x_m, i - half, i + half),
      y = curvature(t, columns.y_m, i - half, i + half);
    const qx = mean(columns.cmd_qx_rad, i - half - delay, i + half - delay),
      qy = mean(columns.cmd_qy_rad, i - half - delay, i + half - delay);
    if (x === null || y === null || qx === null || qy === null) continue;
    ax.push(x);
    ay.push(y);
    ux.push(Math.sin(qy));
    uy.push(-Math.sin(qx));
  }
  return {
    x: { own: correlation(ax, ux), other: correlation(ax, uy) },
    y: { own: correlation(ay, uy), other: correlation(ay, ux) },
    moments: ax.length,
  };
}

function mean(column: (number | null)[], from: number, to: number): number | null {
  let sum = 0,
    n = 0;
  for (let i = from; i <= to; i++) {
    const value = column[i];
    if (value != null) {
      sum += value;
      n++;
    }
  }
  return n ? sum / n : null;
}

/** Second derivative of the parabola through the readings from `from` to `to`, by least squares. */
function curvature(t: (number | null)[], column: (number | null)[], from: number, to: number): number | null {
  const middle = t[(from + to) >> 1];
  if (middle == null) return null;
  let s0 = 0,
    s1 = 0,
    s2 = 0,
    s3 = 0,
    s4 = 0,
    b0 = 0,
    b1 = 0,
    b2 = 0;
  for (let i = from; i <= to; i++) {
    const time = t[i],
      value = column[i];
    if (time == null || value == null) continue;
    const d = time - middle,
      dd = d * d;
    s0++;
    s1 += d;
    s2 += dd;
    s3 += dd * d;
    s4 += dd * dd;
    b0 += value;
    b1 += value * d;
    b2 += value * dd;
  }
  if (s0 < 6) return null;
  const det = s0 * (s2 * s4 - s3 * s3) - s1 * (s1 * s4 - s2 * s3) + s2 * (s1 * s3 - s2 * s2);
  if (Math.abs(det) < 1e-18) return null;
  return (2 * (s0 * (s2 * b2 - s3 * b1) - s1 * (s1 * b2 - s2 * b1) + b0 * (s1 * s3 - s2 * s2))) / det;
}

export function correlation(a: number[], b: number[]): number {
  const n = a.length;
  if (n < 5) return NaN;
  const ma = a.reduce((s, v) => s + v, 0) / n,
    mb = b.reduce((s, v) => s + v, 0) / n;
  let ab = 0,
    aa = 0,
    bb = 0;
  for (let i = 0; i < n; i++) {
    const da = a[i]! - ma,
      db = b[i]! - mb;
    ab += da * db;
    aa += da * da;
    bb += db * db;
  }
  return aa > 0 && bb > 0 ? ab / Math.sqrt(aa * bb) : NaN;
}

export type Verdict = "agrees" | "reversed" | "swapped" | "unclear";

/** Correlations at least so strong speak; measured on simulated rigs, healthy ones come to 0.8 and more. */
const SPEAKS = 0.4;

export function judge({ own, other }: { own: number; other: number }): Verdict {
  if (Number.isNaN(own)) return "unclear";
  if (Math.abs(other) > SPEAKS && Math.abs(other) > 1.5 * Math.abs(own)) return "swapped";
  if (Math.abs(own) < SPEAKS) return "unclear";
  return own > 0 ? "agrees" : "reversed";
}
