/** Marks of fault transitions in the charts of a rig. */
import type { FaultLine, FaultStatus } from "../../api/types";
import { codeTitle } from "../../words/fault-names";
import { isFailing } from "../../words/status-byte";
import type { Mark } from "./overlays";

const COLOURS: Partial<Record<FaultStatus, string>> = { confirmed: "bad", pending: "warn" };

export const faultMark = (line: FaultLine): Mark => ({
  t: line.t_s,
  label: `${codeTitle(line.code)} ${line.status}`,
  colour: (isFailing(line) && COLOURS[line.status]) || "quiet",
});
