/** What a fault line says, without the code that stands before it, as a sentence. */
export function sentence(summary: string): string {
  const text = summary.replace(/^[^:]*: /, "").replace(/-(?=\d)/g, "−");
  return `${capitalised(text)}.`;
}

export const capitalised = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);
