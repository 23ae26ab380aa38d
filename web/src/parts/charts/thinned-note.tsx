interface Props {
  /** Every how many judged moments the drawing has one. */
  stride: number;
  /** What is done with these moments. */
  use?: "drawn" | "counted" | "drawn and counted";
  /** What to do to see all of them. */
  hint?: string;
}

/** Says that judged moments are left out, among which the largest may be; nothing if there are all of them. */
export function ThinnedNote({ stride, use = "drawn", hint }: Props) {
  if (stride <= 1) return null;
  return (
    <p class="late small-text">
      Thinned: one of {stride} judged moments is {use}.{hint && ` ${hint}`}
    </p>
  );
}
