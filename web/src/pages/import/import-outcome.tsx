import type { ImportResult } from "../../api/types";
import { navigate } from "../../router/navigation";
import { sessionPath } from "../../router/paths";
import { count } from "../../words/numbers";

/** Rows that are named. */
const SHOWN = 8;

/** From the index of a sample to the row of the file: the first row has the names. */
const FIRST_ROW = 2;

/** What came of an import of which not all rows went in. */
export function ImportOutcome({ result }: { result: ImportResult }) {
  const { accepted, rejected, late, duplicate, rejections, session } = result;
  return (
    <div>
      <p role="status">
        {count(accepted)} samples are in. {count(rejected)} rows were no samples, {count(late)} came too late
        to be judged, {count(duplicate)} were there already.
      </p>
      {rejections.length > 0 && (
        <ul class="plain quiet">
          {rejections.slice(0, SHOWN).map(({ index, reason }) => (
            <li>
              row {index + FIRST_ROW}: {reason}
            </li>
          ))}
        </ul>
      )}
      <div class="form-end">
        <button type="button" class="primary" onClick={() => navigate(sessionPath(session.id))}>
          Open the session
        </button>
      </div>
    </div>
  );
}
