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
          {certificate.map(({ code, judged_s, nearest, most_alarms_per_hour }) => (
            <tr>
              <th scope="row">{codeTitle(code)}</th>
              <td class="n">{seconds(judged_s, 0)}</td>
              <td class="n">{number(nearest * 100, 0, "%")}</td>
              <td class="n">{falseAlarmRate(most_alarms_per_hour)}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {certificate.some(({ most_alarms_per_hour }) => most_alarms_per_hour != null) && (
        <p class="quiet small-text">
          Nine of ten rigs have fewer. The rates come from simulated rigs with the properties of real ones,
          watched for 94 to 234 h; tests of minutes on this rig change them little.
        </p>
      )}
    </>
  );
}
