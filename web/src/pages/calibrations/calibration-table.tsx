import type { Session } from "../../api/types";
import { CalibrationRow } from "./calibration-row";
import type { DoneJob } from "./history";

const COLUMNS = ["Number", "Made", "Made from", "State", "Action"];

interface Props {
  name: string;
  /** Newest first, each with its number. */
  done: { job: DoneJob; n: number }[];
  /** The id of the chosen calibration. */
  chosen: string;
  choose: (id: string) => void;
  sessions: Session[];
  refetch: () => Promise<void>;
}

/** The history of the calibrations of a rig. */
export function CalibrationTable({ name, done, chosen, choose, sessions, refetch }: Props) {
  return (
    <section class="card">
      <h2>History</h2>
      <div class="scroll" tabIndex={0} role="region" aria-label="History of the calibrations">
        <table class="numbers">
          <thead>
            <tr>
              {COLUMNS.map((word) => (
                <th scope="col">{word}</th>
              ))}
            </tr>
          </thead>
          <tbody>
            {done.map(({ job, n }) => (
              <CalibrationRow
                key={job.id}
                name={name}
                job={job}
                n={n}
                sessions={sessions}
                isChosen={job.id === chosen}
                choose={() => choose(job.id)}
                refetch={refetch}
              />
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}
