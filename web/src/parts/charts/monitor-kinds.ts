/** The kinds of charts of a monitor. */
import type { SharedColumn } from "../../live/axis-columns";
import type { ChartKind } from "./chart-kinds";

const evidence: ChartKind = {
  title: (axis) => `Evidence against the ${axis} servo`,
  term: "evidence",
  unit: "nats",
  digits: 0,
  minExtent: 1,
  isPositive: true,
  showsGates: true,
  lines: [{ column: "nats", label: "evidence", colour: "residual", width: 2 }],
  about:
    "how much better a broken servo explains the motion than a healthy one; the lines are where it decides",
};

const counter: ChartKind = {
  title: (axis) => `Fault detection counter, ${axis} servo`,
  term: "counter",
  unit: "",
  digits: 0,
  minExtent: 127,
  showsGates: true,
  thresholds: [
    { value: 127, label: "failed" },
    { value: -128, label: "passed" },
  ],
  lines: [{ column: "counter", label: "counter", colour: "command", width: 2 }],
  about:
    "it rises with the duration and the weight of the evidence; the test fails at 127 and passes at −128",
};

/** The counter of a monitor that does not belong to an axis. */
const sharedCounter = (of: string, column: SharedColumn): ChartKind => ({
  ...counter,
  title: () => `Fault detection counter, ${of}`,
  showsGates: false,
  lines: [{ column, label: "counter", colour: "command", width: 2 }],
  about: "it rises with the duration of the failure; the test fails at 127 and passes at −128",
});

const stuckBall = sharedCounter("stuck ball", "stuckBall");
const sensor = sharedCounter("position sensor", "sensor");

export const MONITOR_KINDS = { evidence, counter, stuckBall, sensor };
