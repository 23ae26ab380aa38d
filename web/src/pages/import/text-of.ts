/** Number of characters that are searched for those that no text has. */
const SEARCHED = 65_536;

const NO_TEXT =
  "This file is neither a text nor of a format that is read here. Save it as CSV: a line with the names of the " +
  "columns, and a line for each sample.";

/** Whether a text has control characters other than tabs, line ends and page ends, as binary files have. */
export function isBinary(text: string): boolean {
  for (let i = 0; i < Math.min(text.length, SEARCHED); i++) {
    const code = text.charCodeAt(i);
    if (code < 9 || (code > 13 && code < 32)) return true;
  }
  return false;
}

/** Returns the text of a file; throws if it is none. */
export function textOf(bytes: Uint8Array): string {
  const text = decoded(bytes);
  if (isBinary(text)) throw new Error(NO_TEXT);
  return text;
}

/** Decodes the text of a file: UTF-16 if a byte order mark says so, UTF-8 if it is, otherwise Windows-1252. */
function decoded(bytes: Uint8Array): string {
  const mark = `${bytes[0]},${bytes[1]}`;
  const wide = { "255,254": "utf-16le", "254,255": "utf-16be" }[mark];
  if (wide) return new TextDecoder(wide).decode(bytes);
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    // Programs of Windows write ° and µ like this.
    return new TextDecoder("windows-1252").decode(bytes);
  }
}
