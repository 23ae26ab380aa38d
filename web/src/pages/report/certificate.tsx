import type { Asset } from "../../api/types";
import { FalseAlarms } from "../set-up/false-alarms";
import { certificateNote, type JudgedWith } from "./certificate-note";

/** What is known of false alarms of the calibration with which the report's subject was judged. */
export function Certificate({ asset, judged }: { asset: Asset; judged: JudgedWith }) {
  const { text, applies } = certificateNote(asset.calibration, judged);
  const certificate = asset.calibration?.certificate ?? [];
  return (
    <section>
      <h2>Calibration and certificate</h2>
      <p>{text}</p>
      {applies && certificate.length > 0 && <FalseAlarms certificate={certificate} />}
    </section>
  );
}
