import type { ImportResult } from "../../api/types";
import { navigate } from "../../router/navigation";
import { sessionPath } from "../../router/paths";
import { count } from "../../words/numbers";

/** Number of listed rejections. */
const SHOWN = 8;

/** The result of an import of which not all rows were accepted, or that made several sessions. */
export function ImportOutcome({ result }: { result: ImportResult }) {
  const { accepted, rejected, late, duplicate, rejections, session, more_sessions = [] } = result;
  return (
    <div>
      <p role="status">
        {count(accepted)} samples were imported. {count(rejected)} rows were rejected, {count(late)} were too
        late to be judged, {count(duplicate)} were duplicates.
      </p>
      {more_sessions.length > 0 && (
        <p>
          The clock of the recording starts again: it is {count(more_sessions.length + 1)} sessions,{" "}
          {session.name}
          {more_sessions.map(({ name }) => `, ${name}`)}.
        </p>
      )}
      {rejections.length > 0 && (
        <ul class="plain quiet">
          {rejections.slice(0, SHOWN).map(({ index, reason }) => (
            <li>
              row {index + 1}: {reason}
            </li>
          ))}
          {rejected > SHOWN && <li>and {count(rejected - SHOWN)} more</li>}
        </ul>
      )}
      <div class="form-end">
        <button type="button" class="primary" onClick={() => navigate(sessionPath(session.id))}>
          {more_sessions.length > 0 ? "Open the first session" : "Open the session"}
        </button>
      </div>
    </div>
  );
}
