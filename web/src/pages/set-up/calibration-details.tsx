import type { Calibration } from "../../api/types";
import { FalseAlarms } from "./false-alarms";
import { LearntValues } from "./learnt-values";
import { ProspectsTable } from "./prospects-table";

/** The calibration of a rig, its certificate and the detection times. */
export function CalibrationDetails({ calibration }: { calibration: Calibration }) {
  const { certificate, prospects } = calibration;
  return (
    <>
      <LearntValues calibration={calibration} />
      {!!certificate?.length && <FalseAlarms certificate={certificate} />}
      <h3>Detection times</h3>
      {prospects ? (
        <ProspectsTable prospects={prospects} />
      ) : (
        <p class="quiet">Not determined: the sessions are too short.</p>
      )}
      <p>Slower changes are tracked over sessions: the page warns before they become faults.</p>
    </>
  );
}
