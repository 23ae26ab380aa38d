interface Props {
  label: string;
  class?: string;
  /** Empty for the one of the recording. */
  chosen: string;
  choose: (profile: string) => void;
}

/** By which profile of limits a session is judged. */
export function ProfileChoice({ label, class: className, chosen, choose }: Props) {
  return (
    <label class={className}>
      {label}{" "}
      <select value={chosen} onChange={(e) => choose(e.currentTarget.value)}>
        <option value="">as recorded</option>
        <option value="default">default</option>
        <option value="textbook">textbook</option>
      </select>
    </label>
  );
}
