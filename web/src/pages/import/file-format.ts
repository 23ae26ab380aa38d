/** The format of a file by its first bytes. */
import type { FormatName } from "../../api/formats";

/** Bytes that show the format. */
export const HEAD_BYTES = 128;

/** What files begin with, one character for each byte. Other files are text. */
const SIGNATURES: [string, FormatName][] = [
  ["PAR1", "parquet"],
  ["ARROW1\0\0", "arrow"],
  ["\xff\xff\xff\xff", "arrow"],
  ["\x89MCAP0\r\n", "mcap"],
  ["PK\x03\x04", "xlsx"],
];

/** The beginning of files of older versions of Excel. */
const OLD_EXCEL = "\xd0\xcf\x11\xe0";

/** What the archive of an OpenDocument file has in its first bytes. */
const OPEN_DOCUMENT = "mimetypeapplication/vnd.oasis.opendocument";

const OTHER_SPREADSHEET = "Save it as an Excel workbook (.xlsx) or as CSV in the spreadsheet program.";

/** Returns the format of a file that begins with `head`: CSV if it is a text. */
export function fileFormat(head: Uint8Array): FormatName {
  const text = String.fromCharCode(...head.subarray(0, HEAD_BYTES));
  if (text.startsWith(OLD_EXCEL)) throw new Error(`This is an old Excel workbook. ${OTHER_SPREADSHEET}`);
  if (text.includes(OPEN_DOCUMENT)) throw new Error(`This is an OpenDocument file. ${OTHER_SPREADSHEET}`);
  return SIGNATURES.find(([signature]) => text.startsWith(signature))?.[1] ?? "csv";
}
