import type { LearningState } from "../../api/types";
import { DriftChip } from "../../parts/drift-chip";
import { FaultChip } from "../../parts/fault-chip";
import { HealthMark } from "../../parts/health-mark";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { alarmCodeTitle } from "../../words/alarm";
import { NONE, number } from "../../words/numbers";
import { severity } from "../../words/severity";
import { dateTime, sinceText, timeAgo } from "../../words/time";
import { isSilent, presenceOfRow, type FleetRow as Row } from "./rows";

/** Lag from which on it is highlighted, s. */
const LATE_S = 2;

/** Note beside the name of a rig that is not learnt. */
const NOT_LEARNT: Record<LearningState, { word: string; meaning: string }> = {
  gathering: {
    word: "not calibrated",
    meaning: "Calibrated automatically after enough motion; until then, only sensor faults are confirmed",
  },
  learning: { word: "calibrating", meaning: "There is enough motion; the calibration is running" },
  offered: {
    word: "confirm calibration",
    meaning: "A calibration is ready: confirm that the rig was healthy",
  },
  learnt: { word: "", meaning: "" },
};

const COMMUNICATION = "communication_lost";

/** The faults, the worst first. What failed when data stopped is not known to fail now. */
function Faults({ entry }: { entry: Row["entry"] }) {
  const faults = [...entry.faults].sort((a, b) => severity(b) - severity(a));
  const presence = presenceOfRow({ entry });
  return (
    <>
      {faults.map((fault) => (
        <FaultChip
          fault={fault}
          presence={presence}
          since={fault.failed_at}
          isShort={entry.communication_lost_since != null}
        />
      ))}
    </>
  );
}

/** Faults, warnings, and what is not tested. */
function Findings({ entry }: { entry: Row["entry"] }) {
  const isMuted = entry.muted?.some(({ code }) => code === COMMUNICATION);
  return (
    <span class="faults">
      <Faults entry={entry} />
      {entry.warnings.map((warning) => (
        <DriftChip warning={warning} />
      ))}
      {entry.unjudged && (
        <span class="quiet clip" title={entry.unjudged.reason}>
          {entry.unjudged.reason}
        </span>
      )}
      {entry.communication_lost_since && (
        <span
          class={`chip chip-lost ${isMuted ? "chip-muted" : "chip-failing"}`}
          title={`Last data: ${dateTime(entry.communication_lost_since)}`}
        >
          <b>No data</b> since {sinceText(entry.communication_lost_since)}
        </span>
      )}
      {entry.muted?.map((mute) => (
        <span
          class="chip chip-muted"
          title={`Muted by ${mute.by} until ${dateTime(mute.until)}: ${mute.reason}`}
        >
          {mute.code === COMMUNICATION ? "“No data” muted" : `${alarmCodeTitle(mute.code)} not tested`}
        </span>
      ))}
      {entry.stale && (
        <span class="chip chip-muted" title="The node of the cluster that has the rig does not answer">
          not up to date
        </span>
      )}
      {!entry.faults.length &&
        !entry.warnings.length &&
        !entry.unjudged &&
        !entry.stale &&
        !entry.muted?.length &&
        !entry.communication_lost_since && <span class="quiet">none</span>}
    </span>
  );
}

export function FleetRow({ row: { entry, health }, seenAt }: { row: Row; seenAt: number }) {
  const { word, meaning } = NOT_LEARNT[entry.learning];
  const hasLag = entry.session_id != null && !isSilent({ entry });
  return (
    <Link to={rigPath(entry.asset)} class={`fleet-row row-${health}`}>
      <span class="name">
        {entry.asset}
        {!entry.calibrated && !(health === "unlearnt" && entry.learning === "gathering") && (
          <span class="quiet small-text" title={meaning}>
            {" "}
            {word}
          </span>
        )}
        {entry.tags.length > 0 && <span class="quiet small-text"> {entry.tags.join(", ")}</span>}
      </span>
      <HealthMark health={health} />
      <Findings entry={entry} />
      <span class="quiet clip">{entry.session ?? "–"}</span>
      <span class={`n${hasLag && (entry.lag_s ?? 0) > LATE_S ? " late" : ""}`}>
        <span class="only-small">lag </span>
        {hasLag ? number(entry.lag_s, 1, "s") : NONE}
      </span>
      <span class="n quiet">{timeAgo(entry.last_seen, seenAt)}</span>
    </Link>
  );
}
