/** Reads a recording in CSV as a table of strings. */
import Papa from "papaparse";

export interface Table {
  header: string[];
  rows: string[][];
}

const SEPARATORS = [",", ";", "\t"];

/** Number of lines that are searched for the header, which may follow blank lines. */
const HEAD_LINES = 50;

/** Smallest number of columns: time and two coordinates. */
const MIN_COLUMNS = 3;

const TOO_FEW_COLUMNS =
  "The first line names fewer than three columns; it should name them all, " +
  "as in t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m.";
const NO_NAMES = "The first line has numbers; it should have the names of the columns.";
const NO_ROWS = "There are no rows below the first line.";

/** Returns the rows of `text` without comments and blank lines, from at most `limit` lines if given. */
function parse(text: string, delimiter: string, limit = 0): string[][] {
  const config = { delimiter, newline: "\n", comments: "#", preview: limit } as const;
  const { data, errors } = Papa.parse<string[]>(text, config);
  // With a limit, the text may end within quotes that are closed later.
  const unclosed = limit ? undefined : errors.find(({ code }) => code === "MissingQuotes");
  if (unclosed) throw new Error(`Row ${(unclosed.row ?? 0) + 1} has a quote that is never closed.`);
  return data.filter((row) => row.join(delimiter).trim() !== "");
}

/** Returns the most frequent separator of the first line, not counting quoted ones. */
function guessSeparator(text: string): string {
  const count = (separator: string) => parse(text, separator, HEAD_LINES)[0]?.length ?? 0;
  return SEPARATORS.reduce((best, each) => (count(each) > count(best) ? each : best));
}

/** Trims a cell, and removes quotes after a blank, which the parser does not recognize. */
const bare = (cell: string) => cell.trim().replace(/^"(.*)"$/s, "$1");

const isNumber = (text: string) => text !== "" && Number.isFinite(Number(text));

/** Reads a file whose first line has the column names; throws an error with a message for the user. */
export function readTable(file: string): Table {
  const text = file.replace(/^\uFEFF/, "").replace(/\r\n?/g, "\n");
  const separator = guessSeparator(text);
  const [header = [], ...rows] = parse(text, separator).map((row) => row.map(bare));
  if (header.length < MIN_COLUMNS) throw new Error(TOO_FEW_COLUMNS);
  if (header.every(isNumber)) throw new Error(NO_NAMES);
  if (rows.length < 2) throw new Error(NO_ROWS);
  // With semicolons as separators, the comma is the decimal separator.
  if (separator !== ";") return { header, rows };
  return { header, rows: rows.map((row) => row.map((cell) => cell.replace(",", "."))) };
}

/** Returns the numbers of a column; null for cells that are not numbers. */
export function numbersOf({ rows }: Table, index: number): (number | null)[] {
  return rows.map((row) => {
    const cell = row[index];
    return cell !== undefined && isNumber(cell) ? Number(cell) : null;
  });
}
