/** Moments at which a fault changed, marked in the charts of its rig. */
import type { FaultLine } from "../../api/types";
import { codeTitle } from "../../words/fault-names";
import { isFailing } from "../../words/status-byte";
import type { Mark } from "./overlays";

const COLOURS: Record<string, string> = { confirmed: "bad", pending: "warn" };

export const faultMark = (line: FaultLine): Mark => ({
  t: line.t_s,
  label: `${codeTitle(line.code)} ${line.status}`,
  colour: (isFailing(line) && COLOURS[line.status]) || "quiet",
});
