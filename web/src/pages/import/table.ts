/** Reads a recording in CSV as a table of strings. */
import Papa from "papaparse";

export interface Table {
  header: string[];
  rows: string[][];
}

/** Separators, each tried in this order; blanks separate only if none of them does. */
const SEPARATORS = [",", ";", "\t"];

/** Number of lines that are searched for the header, which may follow blank lines and a preamble. */
const HEAD_LINES = 50;

/** Smallest number of columns: time and two coordinates. */
const MIN_COLUMNS = 3;

const EMPTY = "The file is empty.";
const TOO_FEW_COLUMNS =
  "No line has three or more columns, separated by commas, semicolons, tabs or blanks. A recording has " +
  "at least time and two coordinates, as in t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m.";
const NO_ROWS = "There are no rows below the column names.";

/** Returns the rows of `text` without comments and blank lines, from at most `limit` lines if given. */
function parse(text: string, delimiter: string, limit = 0): string[][] {
  const config = { delimiter, newline: "\n", comments: "#", preview: limit } as const;
  const { data, errors } = Papa.parse<string[]>(text, config);
  // With a limit, the text may end within quotes that are closed later.
  const unclosed = limit ? undefined : errors.find(({ code }) => code === "MissingQuotes");
  if (unclosed) throw new Error(`Row ${(unclosed.row ?? 0) + 1} has a quote that is never closed.`);
  return data.filter((row) => row.join(delimiter).trim() !== "");
}

/**
 * Returns the separator with which the names stand in the earliest line; of equal ones that with the most numbers in
 * the line after it, which decimal commas do not add to, and then that of the most columns.
 */
function guessSeparator(text: string): string {
  const names = (separator: string) => {
    const rows = parse(text, separator, HEAD_LINES);
    const line = headerIndex(rows);
    const numbers = rows[line + 1]?.filter((cell) => isNumber(withPoint(bare(cell)))) ?? [];
    return [line < 0 ? -Infinity : -line, numbers.length, rows[line]?.length ?? 0];
  };
  const isBetter = (a: string, b: string) => {
    const [one, other] = [names(a), names(b)];
    const i = one.findIndex((value, i) => value !== other[i]);
    return i >= 0 && one[i]! > other[i]!;
  };
  return SEPARATORS.reduce((best, each) => (isBetter(each, best) ? each : best));
}

/** Trims a cell, and removes quotes after a blank, which the parser does not recognize. */
const bare = (cell: string) => cell.trim().replace(/^"(.*)"$/s, "$1");

const isNumber = (text: string) => text !== "" && Number.isFinite(Number(text));

/**
 * Returns the index of the column names: of the first line that has as many cells as the one after it. The lines
 * before it are a preamble.
 */
function headerIndex(rows: string[][]): number {
  const isTable = (i: number) => rows[i]!.length >= MIN_COLUMNS && rows[i]!.length === rows[i + 1]?.length;
  const found = rows.slice(0, HEAD_LINES).findIndex((_, i) => isTable(i));
  // Rows of unequal length have no preamble that could be told from them.
  return found >= 0 ? found : rows.findIndex((row) => row.length >= MIN_COLUMNS);
}

/** Returns the text with runs of blanks as tabs, if no separator makes three columns of it. */
function withSeparators(text: string): string {
  const hasColumns = SEPARATORS.some((each) => headerIndex(parse(text, each, HEAD_LINES)) >= 0);
  return hasColumns ? text : text.replace(/^ +| +$/gm, "").replace(/ +/g, "\t");
}

/** Reads a table whose first line, apart from a preamble, has the column names; numbers alone get names. */
export function readTable(file: string): Table {
  if (!file.trim()) throw new Error(EMPTY);
  const text = withSeparators(file.replace(/^\uFEFF/, "").replace(/\r\n?/g, "\n"));
  const separator = guessSeparator(text);
  const all = parse(text, separator).map((row) => row.map(bare));
  const start = headerIndex(all);
  if (start < 0) throw new Error(TOO_FEW_COLUMNS);
  const hasCommas = hasDecimalCommas(all.slice(start), separator);
  const isNamed = !all[start]!.every((cell) => isNumber(hasCommas ? withPoint(cell) : cell));
  const header = isNamed ? all[start]! : all[start]!.map((_, i) => `column ${i + 1}`);
  const rows = all.slice(isNamed ? start + 1 : start);
  if (rows.length < 2) throw new Error(NO_ROWS);
  return { header, rows: hasCommas ? rows.map((row) => row.map(withPoint)) : rows };
}

/** A number with a decimal point, and perhaps commas between the thousands. */
const POINT = /^[-+]?[\d,]*\.\d+(e[-+]?\d+)?$/i;

/**
 * Whether commas are decimal separators: always if semicolons separate the columns, with tabs if no number has a
 * decimal point.
 */
function hasDecimalCommas(rows: string[][], separator: string): boolean {
  if (separator !== "\t") return separator === ";";
  return !rows.some((row) => row.some((cell) => POINT.test(cell)));
}

/** Returns a cell with a decimal point instead of a comma. */
const withPoint = (cell: string) => cell.replace(",", ".");

/** Returns the numbers of a column; null for cells that are not numbers. */
export function numbersOf({ rows }: Table, index: number): (number | null)[] {
  return rows.map((row) => {
    const cell = row[index];
    return cell !== undefined && isNumber(cell) ? Number(cell) : null;
  });
}
