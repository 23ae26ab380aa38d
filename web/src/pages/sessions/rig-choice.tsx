/** Selects the rig whose sessions are listed: by typing, since there may be thousands. */
export function RigChoice(props: { names: string[]; chosen: string; change: (name: string) => void }) {
  const { names, chosen, change } = props;
  return (
    <label>
      Rig
      <input
        type="search"
        list="session-assets"
        placeholder="all"
        value={chosen}
        onChange={(e) => change(e.currentTarget.value.trim())}
      />
      <datalist id="session-assets">
        {names.map((name) => (
          <option value={name} />
        ))}
      </datalist>
    </label>
  );
}
