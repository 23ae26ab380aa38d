import program from "../../../../../src/wire/drive_cycle/run.py?raw";
import type { DriveCycle } from "../../../api/types";
import { CodeBlock } from "../../../parts/code-block";
import { Facts } from "../../../parts/facts";
import { saveFile, saveJson } from "../../../parts/save-file";
import { millimetres, number, seconds } from "../../../words/numbers";
import { cycleCsv } from "./cycle-csv";
import { FindableFaults } from "./findable-faults";
import { SetPointPlot } from "./set-point-plot";

const ORDER: Record<string, string> = {
  at_once: "along both axes at once",
  staggered: "along both axes, y a little later",
  in_turn: "along x, then along y",
};

/** The larger of both angles, rad, in degrees with the space that other units have. */
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
              ["Motion", ORDER[cycle.order] ?? cycle.order],
              ["From the middle, x, y", `${millimetres(amplitude_m.x)}, ${millimetres(amplitude_m.y)}`],
              ["Tilt at most", larger(cycle.tilt_rad)],
              ["Level may differ by", larger(cycle.level_within_rad)],
            ]}
          />
          <SetPointPlot cycle={cycle} />
        </div>
        <FindableFaults cycle={cycle} />
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
          It runs the JSON beside it and records what happens. A device with a controller of its own plays the
          set points of the CSV instead. Numbers are in the device's own axes and units.
        </p>
        <CodeBlock label="Drive cycle program">{program}</CodeBlock>
      </details>
    </>
  );
}
