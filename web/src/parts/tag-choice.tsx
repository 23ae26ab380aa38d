interface Props {
  /** The tags in use. */
  tags: string[];
  chosen: string;
  change: (tag: string) => void;
}

/** Selects rigs by a tag; nothing is shown as long as no rig has one. */
export function TagChoice({ tags, chosen, change }: Props) {
  const known = chosen && !tags.includes(chosen) ? [chosen, ...tags] : tags;
  if (!known.length) return null;
  return (
    <label class="inline">
      Tag{" "}
      <select value={chosen} onChange={(e) => change(e.currentTarget.value)}>
        <option value="">any</option>
        {known.map((tag) => (
          <option value={tag}>{tag}</option>
        ))}
      </select>
    </label>
  );
}
