/** Returns the tags in a text: its words, each once. */
export const tagsIn = (text: string): string[] => [...new Set(text.split(/[\s,;]+/).filter(Boolean))];
