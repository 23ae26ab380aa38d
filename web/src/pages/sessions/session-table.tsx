import type { Session } from "../../api/types";
import { SessionRow } from "./session-row";

export function SessionTable({ sessions }: { sessions: Session[] }) {
  return (
    <div class="scroll">
      <table class="list">
        <thead>
          <tr>
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
            <SessionRow key={session.id} session={session} />
          ))}
        </tbody>
      </table>
    </div>
  );
}
