/** The values at which a monitor decides, as lines of its charts, and in words. */
import type { Thresholds } from "../../api/types";
import type { Threshold } from "../../parts/charts/chart-options";
import { seconds } from "../../words/numbers";

/** The lines of the evidence; none if evidence does not decide, as in the textbook profile. */
export function evidenceLines({ suspect_nats, confirm_nats }: Thresholds): Threshold[] {
  if (suspect_nats == null || confirm_nats == null) return [];
  return [
    { value: suspect_nats, label: "suspected" },
    { value: confirm_nats, label: "confirmed" },
  ];
}

/** How long a failure must last until the counter is at its upper end, and until the fault is confirmed. */
export const debounceText = ({ fail_s, confirm_s }: Thresholds) =>
  `The test fails after ${seconds(fail_s)} of failure; the fault is confirmed ${seconds(confirm_s)} later.`;
