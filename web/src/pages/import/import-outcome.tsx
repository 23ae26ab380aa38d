import type { ImportResult } from "../../api/types";
import { navigate } from "../../router/navigation";
import { sessionPath } from "../../router/paths";
import { count } from "../../words/numbers";

/** Number of listed rejections. */
const SHOWN = 8;

/** Row number of the first sample: the first row of the file has the column names. */
const FIRST_ROW = 2;

/** The result of an import of which not all rows were accepted. */
export function ImportOutcome({ result }: { result: ImportResult }) {
  const { accepted, rejected, late, duplicate, rejections, session } = result;
  return (
    <div>
      <p role="status">
        {count(accepted)} samples were imported. {count(rejected)} rows were rejected, {count(late)} were too
        late to be judged, {count(duplicate)} were duplicates.
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
