import type { Calibration } from "../../api/types";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { FalseAlarms } from "./false-alarms";
import { LearntValues } from "./learnt-values";
import { ProspectsTable } from "./prospects-table";

/** The calibration of a rig, its certificate and the detection times. */
export function CalibrationDetails({ name, calibration }: { name: string; calibration: Calibration }) {
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
      <p>
        <Link class="button primary" to={rigPath(name)}>
          Done: open the live view
        </Link>
      </p>
    </>
  );
}
