import type { FleetEntry } from "../api/types";
import { codeTitle } from "../words/fault-names";
import { sentence } from "../words/sentence";

/** A drifting parameter, and the number of sessions until it is a fault. */
export function DriftChip({ warning }: { warning: FleetEntry["warnings"][number] }) {
  const { code, parameter, sessions_left, summary } = warning;
  return (
    <span class="chip chip-drift" title={sentence(summary)}>
      <b>
        {codeTitle(code)}, {parameter}
      </b>{" "}
      <span>{sessions_left == null ? "drifted" : `fault in ${Math.round(sessions_left)} sessions`}</span>
    </span>
  );
}
