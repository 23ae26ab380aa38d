import { Choice } from "./choice";

interface Props {
  /** The tags in use. */
  tags: string[];
  chosen: string;
  change: (tag: string) => void;
  /** Whether the label is above the values instead of beside them. */
  isAbove?: boolean;
}

/** Selects rigs by a tag; nothing is shown as long as no rig has one. */
export function TagChoice({ tags, chosen, change, isAbove }: Props) {
  const known = chosen && !tags.includes(chosen) ? [chosen, ...tags] : tags;
  if (!known.length) return null;
  const options = [["", "any"] as const, ...known.map((tag) => [tag, tag] as const)];
  return <Choice isInline={!isAbove} label="Tag" options={options} value={chosen} change={change} />;
}
