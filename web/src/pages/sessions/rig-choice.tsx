import { useDraft } from "../../hooks/use-draft";

/** Selects the rig whose sessions are listed: by typing, since there may be thousands. */
export function RigChoice(props: { names: string[]; chosen: string; change: (name: string) => void }) {
  const { names, chosen, change } = props;
  const typed = useDraft(chosen, (text) => change(text.trim()));
  return (
    <label>
      Rig
      <input type="search" list="session-assets" placeholder="all" {...typed} />
      <datalist id="session-assets">
        {names.map((name) => (
          <option value={name} />
        ))}
      </datalist>
    </label>
  );
}
