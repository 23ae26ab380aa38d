import type { Profile } from "../../api/types";
import { Choice } from "../../parts/choice";

/** A profile; empty for the one of the recording. */
export type ProfileOrRecorded = Profile | "";

const PROFILES: [ProfileOrRecorded, string][] = [
  ["", "as recorded"],
  ["default", "default"],
  ["textbook", "textbook"],
];

interface Props {
  label: string;
  isInline?: boolean;
  chosen: ProfileOrRecorded;
  choose: (profile: ProfileOrRecorded) => void;
}

/** Selects the profile with which a session is judged. */
export const ProfileChoice = ({ label, isInline, chosen, choose }: Props) => (
  <Choice label={label} isInline={isInline} options={PROFILES} value={chosen} change={choose} />
);
