import type { DriveCycle } from "../../../api/types";
import { codeTitle } from "../../../words/fault-names";
import { seconds } from "../../../words/numbers";

/** Which faults the cycle finds, as what and how soon, and which monitors it does not test. */
export function FindableFaults({ cycle }: { cycle: DriveCycle }) {
  const untested = cycle.monitors.filter((monitor) => monitor.why_not);
  return (
    <div>
      <table class="numbers">
        <thead>
          <tr>
            <th scope="col">If</th>
            <th scope="col">found as</th>
            <th scope="col">within</th>
          </tr>
        </thead>
        <tbody>
          {cycle.faults.map(({ fault, code, beside, after_s }) => (
            <tr>
              <td>{fault}</td>
              <td>
                {codeTitle(code)}
                {beside && <span class="quiet"> or {codeTitle(beside).toLowerCase()}</span>}
              </td>
              <td>{after_s == null ? <span class="quiet">not for sure</span> : seconds(after_s)}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {untested.map(({ code, why_not }) => (
        <p class="note">
          {codeTitle(code)} is not tested: {why_not}.
        </p>
      ))}
    </div>
  );
}
