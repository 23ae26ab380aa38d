import type { FileInspection } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { count } from "../../words/numbers";

interface Props {
  inspection: FileInspection;
  /** Why the file cannot be read by the mapping. */
  problem?: string;
  isBusy: boolean;
  /** Whether the time comes from the rate of the rows, which is not given. */
  lacksRate: boolean;
  hasAsset: boolean;
  send: () => Promise<void>;
  cancel: () => void;
}

/** Why the recording cannot be imported yet; empty if it can. */
function obstacle({ inspection, problem, lacksRate, hasAsset }: Props): string {
  if (problem) return problem;
  if (lacksRate) return "Choose the column of the time, or give the rows per second.";
  if (inspection.rows < 2) return "No two rows can be read: choose the columns.";
  if (inspection.without_ball === 1) return "No row has a position of the ball.";
  return hasAsset ? "" : "Choose the rig.";
}

export function ImportButtons(props: Props) {
  const { inspection, isBusy, send, cancel } = props;
  const problem = obstacle(props);
  return (
    <div class="form-end">
      <span class={problem ? "late" : "quiet"} role="status">
        {isBusy ? "Reading the file…" : problem}
      </span>
      <button type="button" onClick={cancel}>
        Cancel
      </button>
      <ActionButton class="primary" action={send} disabled={isBusy || problem !== ""} needs="operator">
        Import {count(inspection.rows)} rows
      </ActionButton>
    </div>
  );
}
