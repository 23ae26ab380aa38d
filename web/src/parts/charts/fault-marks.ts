/** Marks of fault transitions in the charts of a rig. */
import type { FaultLine, FaultStatus } from "../../api/types";
import { codeTitle } from "../../words/fault-names";
import { changeOf, isRepair } from "../../words/fault-state";
import type { Mark } from "./overlays";

const COLOURS: Partial<Record<FaultStatus, string>> = { confirmed: "bad", pending: "warn" };

export const faultMark = (line: FaultLine): Mark => ({
  t: line.t_s,
  axis: line.axis,
  label: `${codeTitle(line.code)} ${changeOf(line).text}`,
  colour: isRepair(line) ? "good" : (COLOURS[line.status] ?? "quiet"),
});
