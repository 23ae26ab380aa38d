/** Sessions that are compared at a time. */
const COMPARED = 2;

/** Adds `id` to the chosen sessions, or removes it; the earliest choice makes room for a third one. */
export const withToggled = (chosen: string[], id: string): string[] =>
  chosen.includes(id) ? chosen.filter((other) => other !== id) : [...chosen, id].slice(-COMPARED);
