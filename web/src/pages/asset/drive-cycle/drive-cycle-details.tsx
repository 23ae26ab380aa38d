import program from "../../../../../crates/offbd-wire/src/drive_cycle/run.py?raw";
import type { DriveCycle, DriveCycleOrder } from "../../../api/types";
import { CodeBlock } from "../../../parts/code-block";
import { Facts } from "../../../parts/facts";
import { saveFile, saveJson } from "../../../parts/save-file";
import { millimetres, number, seconds } from "../../../words/numbers";
import { cycleCsv } from "./cycle-csv";
import { DetectableFaults } from "./detectable-faults";
import { SetPointPlot } from "./set-point-plot";

const ORDER: Record<DriveCycleOrder, string> = {
  at_once: "along both axes simultaneously",
  staggered: "along both axes, y a quarter of a period later",
  in_turn: "along x, then along y",
};

/** Formats the larger of two angles, rad, in degrees. */
const larger = ({ x, y }: { x: number; y: number }) => number((Math.max(x, y) * 180) / Math.PI, 1, "°");

export function DriveCycleDetails({ cycle }: { cycle: DriveCycle }) {
  const { amplitude_m } = cycle;
  const saveCsv = () => saveFile(new Blob([cycleCsv(cycle)], { type: "text/csv" }), "drive-cycle.csv");
  return (
    <>
      <div class="pair">
        <div>
          <Facts
            facts={[
              ["Duration", seconds(cycle.duration_s)],
              ["Motion", ORDER[cycle.order]],
              ["Amplitude x, y", `${millimetres(amplitude_m.x)}, ${millimetres(amplitude_m.y)}`],
              ["Largest tilt", larger(cycle.tilt_rad)],
              ["Plate may be off level by", larger(cycle.level_within_rad)],
            ]}
          />
          <SetPointPlot cycle={cycle} />
        </div>
        <DetectableFaults cycle={cycle} />
      </div>
      <div class="chips">
        <button type="button" onClick={() => saveJson(cycle, "drive-cycle.json")}>
          Download JSON
        </button>
        <button type="button" onClick={saveCsv}>
          Download CSV
        </button>
      </div>
      <details>
        <summary>A program for the device</summary>
        <p class="quiet small-text">
          It runs drive-cycle.json from its own directory and records the motion. A device with a position
          controller follows the set points of the CSV instead. All values are in the device's axes and units.
        </p>
        <CodeBlock label="Drive cycle program">{program}</CodeBlock>
      </details>
    </>
  );
}
