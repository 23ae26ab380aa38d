/** The values at which a monitor decides, as lines of its charts. */
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

/** The ends of the fault detection counter, with the time of failure that leads to the upper one. */
export function counterLines({ fail_s, confirm_s }: Thresholds): Threshold[] {
  const failed = `failed after ${seconds(fail_s)}, confirmed ${seconds(confirm_s)} later`;
  return [
    { value: 127, label: failed },
    { value: -128, label: "passed" },
  ];
}
