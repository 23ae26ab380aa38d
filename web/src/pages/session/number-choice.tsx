interface Props {
  label: string;
  values: number[];
  text: (value: number) => string;
  chosen: number;
  choose: (value: number) => void;
}

export function NumberChoice({ label, values, text, chosen, choose }: Props) {
  return (
    <label class="inline">
      {label}{" "}
      <select value={chosen} onChange={(e) => choose(Number(e.currentTarget.value))}>
        {values.map((value) => (
          <option value={value}>{text(value)}</option>
        ))}
      </select>
    </label>
  );
}
