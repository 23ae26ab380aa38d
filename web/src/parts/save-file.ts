/** Time after which the URL of a download is revoked, ms. */
const SAVING_MS = 10_000;

/** Downloads `content` as a file called `name`. */
export function saveFile(content: Blob, name: string): void {
  const url = URL.createObjectURL(content);
  Object.assign(document.createElement("a"), { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), SAVING_MS);
}

export const saveJson = (value: unknown, name: string) =>
  saveFile(new Blob([JSON.stringify(value)], { type: "application/json" }), name);
