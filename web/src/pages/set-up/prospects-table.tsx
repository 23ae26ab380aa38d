import type { Prospects, ServoProspects } from "../../api/types";
import { degrees, NONE, number, seconds } from "../../words/numbers";
import { AxisTable, type AxisRow } from "./axis-table";

const foundAfter = (s?: number | null) => (s == null ? "not in 10 s" : seconds(s, 1));

const ROWS: AxisRow<ServoProspects>[] = [
  ["A servo that answers nothing", (servo) => foundAfter(servo.dead_s)],
  ["One that answers half", (servo) => foundAfter(servo.half_gain_s)],
  ["One whose horn has slipped by 1°", (servo) => foundAfter(servo.offset_1deg_s)],
  [
    "Smallest loss of its answer that is found",
    ({ least_gain_loss: loss }) => (loss == null ? NONE : number(loss * 100, 0, "%")),
  ],
  ["Smallest slip that is found", ({ least_offset_rad: slip }) => degrees(slip, 1)],
];

/** How soon a fault would have been confirmed, had it come during the sessions learnt from. */
export function ProspectsTable({ prospects }: { prospects: Prospects }) {
  const { trials, x, y } = prospects;
  const ofBothAxes = [
    { name: "A ball that sticks", after_s: prospects.stuck_s },
    { name: "Readings that freeze", after_s: prospects.frozen_s },
    { name: "No ball seen", after_s: prospects.unseen_s },
  ];
  return (
    <>
      <AxisTable caption={`confirmed after, median of ${trials} trials`} rows={ROWS} x={x} y={y}>
        {ofBothAxes.map(({ name, after_s }) => (
          <tr>
            <th scope="row">{name}</th>
            <td class="n" colSpan={2}>
              {foundAfter(after_s)}
            </td>
          </tr>
        ))}
      </AxisTable>
      <p class="quiet">
        Each fault was put into the sessions that were learnt from, at {trials} moments: with more motion,
        smaller faults are found, and sooner.
      </p>
    </>
  );
}
