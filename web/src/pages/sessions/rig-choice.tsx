import { navigate } from "../../router/navigation";
import { sessionsPath } from "../../router/paths";

/** Selects the rig whose sessions are listed: by typing, since there may be thousands. */
export function RigChoice({ names, chosen, tag }: { names: string[]; chosen: string; tag: string }) {
  return (
    <label class="inline">
      Rig{" "}
      <input
        type="search"
        list="session-assets"
        placeholder="all"
        value={chosen}
        onChange={(e) => navigate(sessionsPath(e.currentTarget.value.trim(), tag), true)}
      />
      <datalist id="session-assets">
        {names.map((name) => (
          <option value={name} />
        ))}
      </datalist>
    </label>
  );
}
