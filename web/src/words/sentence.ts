/** Returns the summary of a fault line as a sentence, without its leading code. */
export function sentence(summary: string): string {
  const text = summary.replace(/^[^:]*: /, "").replace(/-(?=\d)/g, "−");
  return `${capitalised(text)}.`;
}

export const capitalised = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);
