import type { MonitorCertificate } from "../../api/types";
import { codeTitle } from "../../words/fault-names";
import { number, seconds } from "../../words/numbers";
import { falseAlarmRate } from "./false-alarm-rate";

/** The certificate: validation of each monitor on healthy recordings that were not used for learning. */
export function FalseAlarms({ certificate }: { certificate: MonitorCertificate[] }) {
  return (
    <>
      <h3>Expected false alarms</h3>
      <table class="numbers">
        <thead>
          <tr>
            <th scope="col">Tested on held-out recordings</th>
            <th scope="col" class="n">
              Judged
            </th>
            <th scope="col" class="n">
              Closest to the limit
            </th>
            <th scope="col" class="n">
              False alarms
            </th>
          </tr>
        </thead>
        <tbody>
          {certificate.map(({ code, judged_s, nearest, alarms_per_hour }) => (
            <tr>
              <th scope="row">{codeTitle(code)}</th>
              <td class="n">{seconds(judged_s, 0)}</td>
              <td class="n">{number(nearest * 100, 0, "%")}</td>
              <td class="n">{falseAlarmRate(alarms_per_hour)}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <p class="quiet small-text">
        The last two come mostly from 63 simulated rigs (1 and 28 in 252 h), and are not measured on this rig.
      </p>
    </>
  );
}
