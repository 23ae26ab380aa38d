import { useState } from "preact/hooks";
import type { Session } from "../../api/types";
import { Link } from "../../router/link";
import { comparePath } from "../../router/paths";
import { SessionRow } from "./session-row";
import { withToggled } from "./with-toggled";

export function SessionTable({ sessions }: { sessions: Session[] }) {
  const [chosen, setChosen] = useState<string[]>([]);
  const [a, b] = chosen;
  return (
    <>
      <p class="small-text">
        {a && b ? (
          <Link to={comparePath(a, b)}>Compare the two chosen sessions</Link>
        ) : (
          <span class="quiet">Choose two sessions to compare them.</span>
        )}
      </p>
      <div class="scroll">
        <table class="list alarms">
          <thead>
            <tr>
              <th>
                <span class="hidden">Compare</span>
              </th>
              <th>Session</th>
              <th>Verdict</th>
              <th>Rig</th>
              <th>Started</th>
              <th class="n">Length</th>
              <th class="n">Samples</th>
            </tr>
          </thead>
          <tbody>
            {sessions.map((session) => (
              <SessionRow
                key={session.id}
                session={session}
                isChosen={chosen.includes(session.id)}
                toggle={() => setChosen((before) => withToggled(before, session.id))}
              />
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}
