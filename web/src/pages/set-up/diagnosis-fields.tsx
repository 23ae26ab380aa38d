import { useState } from "preact/hooks";
import type { FieldsProps } from "./number-input";
import { OptionalNumber } from "./optional-number";

/** Greatest debounce time, s, and the range of accepted false alarms per year, as the service has them. */
const LONGEST_S = 60;
const LEAST_ALARMS = 1e-6;
const MOST_ALARMS = 1e6;

/** The settings of the diagnosis, which most owners leave as they are. */
export function DiagnosisFields(fields: FieldsProps) {
  const { debounce, falseAlarms } = fields.description;
  const [isSet] = useState(!Number.isNaN(debounce) || !Number.isNaN(falseAlarms));
  return (
    <details class="advanced" open={isSet}>
      <summary>Advanced: when a fault is reported</summary>
      <OptionalNumber {...fields} field="debounce" label="Debounce time, s" min={0} max={LONGEST_S}>
        How long a failure must last before a test fails, 0 to 60 s, for all monitors. A longer time keeps
        brief disturbances from being reported, and reports faults that much later. Empty: 0.3 to 0.6 s, by
        monitor.
      </OptionalNumber>
      <OptionalNumber
        {...fields}
        field="falseAlarms"
        label="Accepted false servo alarms per rig and year"
        min={LEAST_ALARMS}
        max={MOST_ALARMS}
      >
        For a healthy rig that always runs; at most a million. Fewer false alarms need more evidence: faults
        are found later, and small ones not at all. Empty: about 26 a year. This is for the servos alone: for
        ball and sensor, choose the debounce time. What is expected of each is shown after the calibration.
      </OptionalNumber>
      <p class="quiet small-text">Applies from the next session.</p>
    </details>
  );
}
