interface Props {
  /** What the column is called. */
  word: string;
  sign: 1 | -1;
  choose: (sign: 1 | -1) => void;
}

/** Which way round a column is. */
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
