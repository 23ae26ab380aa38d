/** Returns the text of a file: UTF-16 if a byte order mark says so, UTF-8 if it is, otherwise Windows-1252. */
export function textOf(bytes: Uint8Array): string {
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
