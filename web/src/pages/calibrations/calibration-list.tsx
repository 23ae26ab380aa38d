import { useState } from "preact/hooks";
import type { CalibrationJob, Session } from "../../api/types";
import { EmptyState } from "../../parts/empty-state";
import { Link } from "../../router/link";
import { setUpPath } from "../../router/paths";
import { CalibrationCard } from "./calibration-card";
import { CalibrationTable } from "./calibration-table";
import { FitCard } from "./fit-card";
import { numbered, previous } from "./history";

interface Props {
  name: string;
  /** Newest first. */
  jobs: CalibrationJob[];
  sessions: Session[];
  refetch: () => Promise<void>;
}

/** The history of the calibrations, and the chosen one of them. */
export function CalibrationList({ name, jobs, sessions, refetch }: Props) {
  const [id, choose] = useState<string>();
  const done = numbered(jobs);
  const chosen = done.find(({ job }) => job.id === id) ?? done.find(({ job }) => job.active) ?? done[0];
  if (!chosen)
    return (
      <EmptyState title="This rig is not calibrated yet">
        <p>
          <Link to={setUpPath(name, "learn")}>Choose recordings for its calibration</Link>
        </p>
      </EmptyState>
    );
  return (
    <>
      <CalibrationTable
        name={name}
        done={done}
        chosen={chosen.job.id}
        choose={choose}
        sessions={sessions}
        refetch={refetch}
      />
      <CalibrationCard n={chosen.n} calibration={chosen.job.calibration} />
      <FitCard
        key={chosen.job.id}
        n={chosen.n}
        calibration={chosen.job.id}
        before={previous(jobs, chosen.job.id)}
        sessions={sessions}
      />
    </>
  );
}
