import type { Calibration } from "../../api/types";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { FalseAlarms } from "./false-alarms";
import { LearntValues } from "./learnt-values";
import { ProspectsTable } from "./prospects-table";

/** What was learnt of a rig, and what that is worth. */
export function CalibrationDetails({ name, calibration }: { name: string; calibration: Calibration }) {
  const { certificate, prospects } = calibration;
  return (
    <>
      <LearntValues calibration={calibration} />
      {!!certificate?.length && <FalseAlarms certificate={certificate} />}
      <h3>What can be found, how fast</h3>
      {prospects ? (
        <ProspectsTable prospects={prospects} />
      ) : (
        <p class="quiet">Not tried: the sessions are too short for it.</p>
      )}
      <p>Slower changes are followed over the sessions and warned of before they are faults.</p>
      <p>
        <Link class="button primary" to={rigPath(name)}>
          Done: see it live
        </Link>
      </p>
    </>
  );
}
