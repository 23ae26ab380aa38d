import { HealthMark } from "../../parts/health-mark";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { driftText, driftTitle } from "../../words/drift";
import { faultTitle } from "../../words/fault-names";
import { stateText } from "../../words/fault-state";
import { severity } from "../../words/severity";
import { sinceText } from "../../words/time";
import { presenceOfRow, type FleetRow } from "./rows";

/** The worst finding of a rig in a few words. */
function worstFinding({ entry }: FleetRow): string {
  const [worst] = [...entry.faults].sort((a, b) => severity(b) - severity(a));
  const [drift] = entry.warnings;
  const lost = entry.communication_lost_since;
  const silence = lost ? `no data since ${sinceText(lost)}` : "";
  if (silence && worst?.failing) return `${faultTitle(worst, true)}, then ${silence}`;
  if (silence) return silence;
  if (!worst && drift) return `${driftTitle(drift)}: ${driftText(drift)}`;
  if (!worst) return entry.unjudged?.reason ?? entry.session ?? "";
  const since = worst.failed_at ? sinceText(worst.failed_at) : undefined;
  return `${faultTitle(worst, true)} ${stateText(worst, presenceOfRow({ entry }), since)}`;
}

export function WallTile({ row }: { row: FleetRow }) {
  return (
    <Link to={rigPath(row.entry.asset)} class={`tile tile-${row.health}`}>
      <b class="clip">{row.entry.asset}</b>
      <HealthMark health={row.health} />
      <span>{worstFinding(row)}</span>
    </Link>
  );
}
