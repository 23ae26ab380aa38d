import { useDraft } from "../../hooks/use-draft";

interface Props {
  mapping: string;
  change: (mapping: string) => void;
}

/** The whole mapping as a text, for sums, factors and offsets, and to be kept for other files. */
export function MappingText({ mapping, change }: Props) {
  const typed = useDraft(mapping, change);
  return (
    <details>
      <summary>Mapping as a text</summary>
      <p class="note">
        For factors and offsets, such as <code>x_m=ball_px*0.000235-0.079</code>. The same text is understood
        by <code>--columns</code> of the command line and <code>columns</code> of the API.
      </p>
      <textarea aria-label="Mapping of the columns" rows={2} spellcheck={false} {...typed} />
    </details>
  );
}
