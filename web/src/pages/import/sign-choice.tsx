interface Props {
  /** Title of the quantity. */
  word: string;
  sign: 1 | -1;
  choose: (sign: 1 | -1) => void;
}

/** Selects the sign of a column. */
export function SignChoice({ word, sign, choose }: Props) {
  return (
    <select
      aria-label={`Sign of ${word}`}
      value={sign}
      onChange={(e) => choose(Number(e.currentTarget.value) as 1 | -1)}
    >
      <option value={1}>+</option>
      <option value={-1}>−</option>
    </select>
  );
}
