import type { JudgedMonitor } from "../../api/types";
import { codeTitle } from "../../words/fault-names";
import { judgedShare, resultText } from "../../words/verdict";

/** The part of the session that each monitor judged, and its result. */
export function JudgedShares({ monitors }: { monitors: JudgedMonitor[] }) {
  if (monitors.length === 0) return null;
  return (
    <table class="list judged">
      <caption class="quiet small-text">Judged part of the session</caption>
      <thead>
        <tr>
          <th scope="col">Monitor</th>
          <th scope="col" class="n">
            Judged
          </th>
          <th scope="col">Result</th>
        </tr>
      </thead>
      <tbody>
        {monitors.map((monitor) => (
          <tr>
            <th scope="row">{codeTitle(monitor.code)}</th>
            <td class="n">{judgedShare(monitor)}</td>
            <td>{resultText(monitor.outcome)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
