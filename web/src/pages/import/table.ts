/** A recording of anybody's making, read as a table of texts. */
import Papa from "papaparse";

export interface Table {
  header: string[];
  rows: string[][];
}

const SEPARATORS = [",", ";", "\t"];

/** Lines among which the first with names is looked for: blank ones may stand before it. */
const HEAD_LINES = 50;

/** A table of fewer columns has no position over time. */
const LEAST_COLUMNS = 3;

const TOO_FEW_COLUMNS =
  "The first line names fewer than three columns; it should name them all, " +
  "as in t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m.";
const NO_NAMES = "The first line has numbers; it should have the names of the columns.";
const NO_ROWS = "There are no rows below the first line.";

/** The rows of `text`, without comments and blank lines; at most `most` lines of it if given. */
function parse(text: string, delimiter: string, most = 0): string[][] {
  const config = { delimiter, newline: "\n", comments: "#", preview: most } as const;
  const { data, errors } = Papa.parse<string[]>(text, config);
  // A preview may end within quotes that are closed later.
  const unclosed = most ? undefined : errors.find(({ code }) => code === "MissingQuotes");
  if (unclosed) throw new Error(`In row ${(unclosed.row ?? 0) + 1} a quote is opened that is never closed.`);
  return data.filter((row) => row.join(delimiter).trim() !== "");
}

/** The separator that the first line has most of; those within quotes do not count. */
function guessSeparator(text: string): string {
  const count = (separator: string) => parse(text, separator, HEAD_LINES)[0]?.length ?? 0;
  return SEPARATORS.reduce((best, each) => (count(each) > count(best) ? each : best));
}

/** A cell without blanks and without quotes that stand behind a blank, which are none to the parser. */
const bare = (cell: string) => cell.trim().replace(/^"(.*)"$/s, "$1");

const isNumber = (text: string) => text !== "" && Number.isFinite(Number(text));

/** Reads a file whose first line names its columns; an error says in words what is wrong with it. */
export function readTable(file: string): Table {
  const text = file.replace(/^\uFEFF/, "").replace(/\r\n?/g, "\n");
  const separator = guessSeparator(text);
  const [header = [], ...rows] = parse(text, separator).map((row) => row.map(bare));
  if (header.length < LEAST_COLUMNS) throw new Error(TOO_FEW_COLUMNS);
  if (header.every(isNumber)) throw new Error(NO_NAMES);
  if (rows.length < 2) throw new Error(NO_ROWS);
  // Where semicolons separate, the comma is that of decimals.
  if (separator !== ";") return { header, rows };
  return { header, rows: rows.map((row) => row.map((cell) => cell.replace(",", "."))) };
}

/** A column's numbers; null where a cell has none. */
export function numbersOf({ rows }: Table, index: number): (number | null)[] {
  return rows.map((row) => {
    const cell = row[index];
    return cell !== undefined && isNumber(cell) ? Number(cell) : null;
  });
}
