import type { Calibration } from "../../api/types";
import { CalibrationDetails } from "../set-up/calibration-details";
import { undetermined } from "./history";
import { UncertaintyTable } from "./uncertainty-table";

/** The chosen calibration: what was learnt, how sure it is, and what was not determined. */
export function CalibrationCard({ n, calibration }: { n: number; calibration: Calibration }) {
  const open = undetermined(calibration);
  return (
    <section class="card">
      <h2>Values of calibration {n}</h2>
      {open.length > 0 && <p>Not determined: {open.join(", ")}.</p>}
      <CalibrationDetails calibration={calibration} />
      <h3>Uncertainty</h3>
      <UncertaintyTable calibration={calibration} />
    </section>
  );
}
