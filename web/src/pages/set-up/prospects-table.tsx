import type { Prospects, ServoProspects } from "../../api/types";
import { degrees, NONE, number, seconds } from "../../words/numbers";
import { AxisTable, type AxisRow } from "./axis-table";

const foundAfter = (s?: number | null) => (s == null ? "not within 10 s" : seconds(s, 1));

const ROWS: AxisRow<ServoProspects>[] = [
  ["Servo without response", (servo) => foundAfter(servo.dead_s)],
  ["Servo with half its gain", (servo) => foundAfter(servo.half_gain_s)],
  ["Servo horn slipped by 1°", (servo) => foundAfter(servo.offset_1deg_s)],
  [
    "Smallest detectable loss of gain",
    ({ least_gain_loss: loss }) => (loss == null ? NONE : number(loss * 100, 0, "%")),
  ],
  ["Smallest detectable slip", ({ least_offset_rad: slip }) => degrees(slip, 1)],
];

/** Time to confirmation of each fault if it occurred during the sessions used for learning. */
export function ProspectsTable({ prospects }: { prospects: Prospects }) {
  const { trials, x, y } = prospects;
  const ofBothAxes = [
    { name: "Ball stuck", after_s: prospects.stuck_s },
    { name: "Readings frozen", after_s: prospects.frozen_s },
    { name: "Ball not seen", after_s: prospects.unseen_s },
  ];
  return (
    <>
      <AxisTable caption={`Confirmed after, median of ${trials} trials`} rows={ROWS} x={x} y={y}>
        {ofBothAxes.map(({ name, after_s }) => (
          <tr>
            <th scope="row">{name}</th>
            <td class="both" colSpan={2}>
              {foundAfter(after_s)}
            </td>
          </tr>
        ))}
      </AxisTable>
      <p class="quiet">
        Each fault was injected into the sessions of the calibration, at {trials} times. With more motion,
        smaller faults are detected, and earlier.
      </p>
    </>
  );
}
