import type { Evidence, Thresholds } from "../../api/types";
import { millimetres, plural, seconds } from "../../words/numbers";
import { evidenceRows } from "./evidence-rows";

/** The values of the evidence that belong to no axis, as text. */
function remarks(evidence: Evidence): string {
  const { healthy_scatter_m, jump } = evidence;
  const healthy = healthy_scatter_m ? ` (healthy: ${millimetres(healthy_scatter_m, 2)})` : "";
  const jumped = jump ? `; readings jumped by ${millimetres(jump.size_m, 0)} at ${seconds(jump.t_s)}` : "";
  return (
    `Averaged over ${seconds(evidence.window_s)}; ball not seen for ${seconds(evidence.unseen_s)}; ` +
    `readings identical for ${seconds(evidence.identical_s)}; ball at rest for ${seconds(evidence.still_s)}; ` +
    `${plural(evidence.outliers, "outlier")} in 10 s; ` +
    `scatter ${millimetres(evidence.scatter_m, 2)}${healthy}${jumped}.`
  );
}

/** The evidence at one moment as a table: the innovation record or a freeze frame. */
export function EvidenceTable({ evidence, thresholds }: { evidence: Evidence; thresholds?: Thresholds[] }) {
  return (
    <>
      <div class="scroll" tabIndex={0} role="region" aria-label="Evidence at that time">
        <table class="numbers">
          <thead>
            <tr>
              <th scope="col">At {seconds(evidence.t_s)}</th>
              <th scope="col" class="n">
                x
              </th>
              <th scope="col" class="n">
                y
              </th>
            </tr>
          </thead>
          <tbody>
            {evidenceRows(evidence, thresholds).map(({ name, cells }) => (
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
