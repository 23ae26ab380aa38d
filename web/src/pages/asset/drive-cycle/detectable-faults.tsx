import type { DriveCycle } from "../../../api/types";
import { codeTitle } from "../../../words/fault-names";
import { seconds } from "../../../words/numbers";

/** The faults that the cycle detects, with code and time, and the monitors that it does not test. */
export function DetectableFaults({ cycle }: { cycle: DriveCycle }) {
  const untested = cycle.monitors.filter((monitor) => monitor.why_not);
  return (
    <div>
      <table class="numbers">
        <thead>
          <tr>
            <th scope="col">Fault</th>
            <th scope="col">Reported as</th>
            <th scope="col">Within</th>
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
              <td>{after_s == null ? <span class="quiet">not in every trial</span> : seconds(after_s)}</td>
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
