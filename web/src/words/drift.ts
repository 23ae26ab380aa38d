/** The words of a warning of a drifting parameter. */
import type { FleetEntry } from "../api/types";
import { codeTitle } from "./fault-names";

type Warning = FleetEntry["warnings"][number];

/** What drifts. */
export const driftTitle = ({ code, parameter }: Warning) => `${codeTitle(code)}, ${parameter}`;

/** How far it has drifted. */
export const driftText = ({ sessions_left }: Warning) =>
  sessions_left == null ? "drifted" : `fault in ${Math.round(sessions_left)} sessions`;
