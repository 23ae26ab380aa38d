/** How long a browser may take to begin saving what it is given, ms. */
const SAVING_MS = 10_000;

/** Lets the browser save `content` under `name`, as a download. */
export function saveFile(content: Blob, name: string): void {
  const url = URL.createObjectURL(content);
  Object.assign(document.createElement("a"), { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), SAVING_MS);
}

export const saveJson = (value: unknown, name: string) =>
  saveFile(new Blob([JSON.stringify(value)], { type: "application/json" }), name);
