/** The drive cycle: the motion in which every monitor comes to a result, to be seen and taken along. */
import { useState } from "preact/hooks";
import program from "../../../src/wire/drive_cycle/run.py?raw";
import { api } from "../api/client";
import type { Asset, DriveCycle } from "../api/types";
import { codeTitle, millimetres, number, seconds } from "../words";
import { Act, Code, Facts } from "./bits";
import { save } from "./rig-view";

export function DriveCycleCard({ asset }: { asset: Asset }) {
  const [cycle, setCycle] = useState<DriveCycle>();
  return (
    <section class="card" id="drive-cycle">
      <h2>Drive cycle</h2>
      <p class="quiet">
        A short motion in which every monitor comes to a result: for the start of a day, and where a verdict
        says that it cannot tell.
      </p>
      {!asset.calibration && (
        <p>Neither the servos nor the ball can be tested before the rig has been learnt.</p>
      )}
      {asset.calibration && !cycle && (
        <Act act={async () => setCycle(await api.driveCycle(asset.name))}>Work it out</Act>
      )}
      {cycle && <Cycle cycle={cycle} />}
    </section>
  );
}

function Cycle({ cycle }: { cycle: DriveCycle }) {
  const degrees = (of: { x: number; y: number }) => number((Math.max(of.x, of.y) * 180) / Math.PI, 1, "°");
  return (
    <>
      <div class="pair">
        <div>
          <Facts
            of={[
              ["Duration", seconds(cycle.duration_s)],
              ["Motion", ORDER[cycle.order] ?? cycle.order],
              [
                "From the middle, x, y",
                `${millimetres(cycle.amplitude_m.x)}, ${millimetres(cycle.amplitude_m.y)}`,
              ],
              ["Tilt at most", degrees(cycle.tilt_rad)],
              ["Level may differ by", degrees(cycle.level_within_rad)],
            ]}
          />
          <Plot cycle={cycle} />
        </div>
        <Found cycle={cycle} />
      </div>
      <div class="chips">
        <button
          type="button"
          onClick={() =>
            save(new Blob([JSON.stringify(cycle)], { type: "application/json" }), "drive-cycle.json")
          }
        >
          Download JSON
        </button>
        <button
          type="button"
          onClick={() => save(new Blob([csv(cycle)], { type: "text/csv" }), "drive-cycle.csv")}
        >
          Download CSV
        </button>
      </div>
      <details>
        <summary>A program for the device</summary>
        <p class="quiet small-text">
          It runs the JSON beside it and records what happens. A device with a controller of its own plays the
          set points of the CSV instead. Numbers are in the device's own axes and units.
        </p>
        <Code label="Drive cycle program">{program}</Code>
      </details>
    </>
  );
}

const ORDER: Record<string, string> = {
  at_once: "along both axes at once",
  staggered: "along both axes, y a little later",
  in_turn: "along x, then along y",
};

const COLUMNS = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"] as const;

const csv = ({ rows }: DriveCycle) =>
  [COLUMNS.join(","), ...rows.t_s.map((_, i) => COLUMNS.map((name) => rows[name][i] ?? "").join(","))].join(
    "\n",
  ) + "\n";

function Found({ cycle }: { cycle: DriveCycle }) {
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
          {cycle.faults.map((fault) => (
            <tr>
              <td>{fault.fault}</td>
              <td>
                {codeTitle(fault.code)}
                {fault.beside && <span class="quiet"> or {codeTitle(fault.beside).toLowerCase()}</span>}
              </td>
              <td>
                {fault.after_s == null ? <span class="quiet">not for sure</span> : seconds(fault.after_s)}
              </td>
            </tr>
          ))}
        </tbody>
      </table>
      {cycle.monitors
        .filter((monitor) => monitor.why_not)
        .map((monitor) => (
          <p class="note">
            {codeTitle(monitor.code)} is not tested: {monitor.why_not}.
          </p>
        ))}
    </div>
  );
}

const WIDTH = 320,
  HEIGHT = 120,
  ROOM = 6;

/** The set points over time. */
function Plot({ cycle: { rows, duration_s } }: { cycle: DriveCycle }) {
  const values = [...rows.x_m, ...rows.y_m].filter((value): value is number => value !== null);
  const most = Math.max(...values.map(Math.abs), 1e-9);
  const path = (of: (number | null)[]) =>
    of
      .flatMap((value, i) =>
        value === null
          ? []
          : [`${(WIDTH * rows.t_s[i]!) / duration_s},${HEIGHT / 2 - ((HEIGHT / 2 - ROOM) * value) / most}`],
      )
      .join(" ");
  return (
    <figure class="trend">
      <svg
        viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
        role="img"
        aria-label={`Set points over ${seconds(duration_s)}`}
      >
        <line class="nominal" x1={0} x2={WIDTH} y1={HEIGHT / 2} y2={HEIGHT / 2} />
        <polyline class="cycle-x" points={path(rows.x_m)} />
        <polyline class="cycle-y" points={path(rows.y_m)} />
      </svg>
      <figcaption>
        <span>
          <span class="cycle-x">━</span> x
        </span>{" "}
        <span>
          <span class="cycle-y">┅</span> y
        </span>{" "}
        <span class="quiet">set points over {seconds(duration_s)}</span>
      </figcaption>
    </figure>
  );
}
