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
const WORKBOOK = "This is a spreadsheet, not a text file. Save it as CSV in the spreadsheet program.";
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

/** Returns the separator with which the names stand in the earliest line; of equal ones that of the most columns. */
function guessSeparator(text: string): string {
  const names = (separator: string) => {
    const rows = parse(text, separator, HEAD_LINES);
    const line = headerIndex(rows);
    return { line: line < 0 ? Infinity : line, columns: rows[line]?.length ?? 0 };
  };
  const isBetter = (a: string, b: string) => {
    const [one, other] = [names(a), names(b)];
    return one.line < other.line || (one.line === other.line && one.columns > other.columns);
  };
  return SEPARATORS.reduce((best, each) => (isBetter(each, best) ? each : best));
}

/** Trims a cell, and removes quotes after a blank, which the parser does not recognize. */
const bare = (cell: string) => cell.trim().replace(/^"(.*)"$/s, "$1");

const isNumber = (text: string) => text !== "" && Number.isFinite(Number(text));

/** The beginning of a ZIP archive, which .xlsx and .ods files are, as text. */
const ZIP = "PK\u0003\u0004";

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
  if (file.startsWith(ZIP)) throw new Error(WORKBOOK);
  if (!file.trim()) throw new Error(EMPTY);
  const text = withSeparators(file.replace(/^\uFEFF/, "").replace(/\r\n?/g, "\n"));
  const separator = guessSeparator(text);
  const all = parse(text, separator).map((row) => row.map(bare));
  const start = headerIndex(all);
  if (start < 0) throw new Error(TOO_FEW_COLUMNS);
  const isNamed = !all[start]!.every((cell) => isNumber(decimal(cell, separator)));
  const header = isNamed ? all[start]! : all[start]!.map((_, i) => `column ${i + 1}`);
  const rows = all.slice(isNamed ? start + 1 : start);
  if (rows.length < 2) throw new Error(NO_ROWS);
  if (separator !== ";") return { header, rows };
  return { header, rows: rows.map((row) => row.map((cell) => decimal(cell, separator))) };
}

/** Returns a cell with a decimal point: with semicolons as separators, the comma is the decimal separator. */
const decimal = (cell: string, separator: string) => (separator === ";" ? cell.replace(",", ".") : cell);

/** Returns the numbers of a column; null for cells that are not numbers. */
export function numbersOf({ rows }: Table, index: number): (number | null)[] {
  return rows.map((row) => {
    const cell = row[index];
    return cell !== undefined && isNumber(cell) ? Number(cell) : null;
  });
}
