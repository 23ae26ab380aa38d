import type { Evidence } from "../../api/types";
import { millimetres, seconds } from "../../words/numbers";
import { evidenceRows } from "./evidence-rows";

/** What the table leaves out of the evidence, in words. */
function remarks(evidence: Evidence): string {
  const { healthy_scatter_m, jump } = evidence;
  const healthy = healthy_scatter_m ? `, of healthy readings ${millimetres(healthy_scatter_m, 2)}` : "";
  const jumped = jump ? `; readings stepped by ${millimetres(jump.size_m, 0)} at ${seconds(jump.t_s)}` : "";
  return (
    `Window ${seconds(evidence.window_s)}; no ball seen for ${seconds(evidence.unseen_s)}; ` +
    `readings identical for ${seconds(evidence.identical_s)}; ball at rest for ${seconds(evidence.still_s)}; ` +
    `${evidence.outliers} readings set aside in 10 s; ` +
    `scatter ${millimetres(evidence.scatter_m, 2)}${healthy}${jumped}.`
  );
}

/** The numbers at one moment, as a table: the innovation record or a freeze frame. */
export function EvidenceTable({ evidence }: { evidence: Evidence }) {
  return (
    <>
      <div class="scroll" tabIndex={0} role="region" aria-label="Numbers at that moment">
        <table class="numbers">
          <thead>
            <tr>
              <th scope="col">at {seconds(evidence.t_s)}</th>
              <th scope="col" class="n">
                x
              </th>
              <th scope="col" class="n">
                y
              </th>
            </tr>
          </thead>
          <tbody>
            {evidenceRows(evidence).map(({ name, cells }) => (
              <tr>
                <th scope="row">{name}</th>
                {cells.map(({ text, isBeyondLimit }) => (
                  <td class={`n${isBeyondLimit ? " bad" : ""}`}>{text}</td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <p class="quiet small-text">{remarks(evidence)}</p>
    </>
  );
}
