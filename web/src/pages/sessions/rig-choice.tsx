import { navigate } from "../../router/navigation";
import { sessionsPath } from "../../router/paths";

/** Selects the rig whose sessions are listed. */
export function RigChoice({ names, chosen }: { names: string[]; chosen: string }) {
  return (
    <label class="inline">
      Rig{" "}
      <select value={chosen} onChange={(e) => navigate(sessionsPath(e.currentTarget.value), true)}>
        <option value="">all</option>
        {names.map((name) => (
          <option value={name}>{name}</option>
        ))}
      </select>
    </label>
  );
}
