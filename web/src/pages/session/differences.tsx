import type { FaultLine, Replay } from "../../api/types";
import { faultTitle } from "../../words/fault-names";
import { changeOf } from "../../words/fault-state";
import { NONE, seconds } from "../../words/numbers";

/** Number of displayed rows. */
const SHOWN = 200;

/** The differences between two verdicts of a session. */
export function Differences({ differences }: Pick<NonNullable<Replay["result"]>, "differences">) {
  return (
    <div class="scroll differences" tabIndex={0} role="region" aria-label="Differences">
      <table class="list">
        <thead>
          <tr>
            <th class="n">Time</th>
            <th>Recorded</th>
            <th class="n">Time</th>
            <th>Judged again</th>
            <th class="n">Moved</th>
          </tr>
        </thead>
        <tbody>
          {differences.slice(0, SHOWN).map(({ recorded, replayed, moved_s }) => (
            <tr>
              {[recorded, replayed].map((line) => (
                <>
                  <td class="n">{seconds(line?.t_s)}</td>
                  <td>{line ? describe(line) : <span class="quiet">{NONE}</span>}</td>
                </>
              ))}
              <td class="n">{moved_s ? movedText(moved_s) : ""}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

const movedText = (by: number) => `${seconds(Math.abs(by))} ${by < 0 ? "earlier" : "later"}`;

function describe(line: FaultLine) {
  const { text, look } = changeOf(line);
  return (
    <>
      {faultTitle(line)} <span class={look}>{text}</span>
    </>
  );
}
