import type { Profile } from "../../api/types";

/** A profile; empty for the one of the recording. */
export type ProfileOrRecorded = Profile | "";

interface Props {
  label: string;
  class?: string;
  chosen: ProfileOrRecorded;
  choose: (profile: ProfileOrRecorded) => void;
}

/** Selects the profile with which a session is judged. */
export function ProfileChoice({ label, class: className, chosen, choose }: Props) {
  return (
    <label class={className}>
      {label}{" "}
      <select value={chosen} onChange={(e) => choose(e.currentTarget.value as ProfileOrRecorded)}>
        <option value="">as recorded</option>
        <option value="default">default</option>
        <option value="textbook">textbook</option>
      </select>
    </label>
  );
}
