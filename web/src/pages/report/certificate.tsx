import { api } from "../../api/client";
import type { Asset } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { FalseAlarms } from "../set-up/false-alarms";
import { certificateNote } from "./certificate-note";

interface Props {
  asset: Asset;
  /** The session in which the report's subject was judged. */
  session: string;
  /** Id of the calibration, for a session that may have been deleted. */
  id?: string | null;
}

/** What is known of false alarms of the calibration with which the report's subject was judged. */
export function Certificate({ asset, session, id }: Props) {
  const { data, error } = useQuery(() => api.sessionCalibration(session), `${session} calibration`);
  if (!data && !error) return null;
  const present = asset.calibration;
  const kept = id && id === present?.id ? present : undefined;
  const judged = data ? (data.calibration ?? null) : kept;
  const certificate = judged?.certificate ?? [];
  return (
    <section>
      <h2>Calibration and certificate</h2>
      <p>{certificateNote(judged, id, present)}</p>
      {certificate.length > 0 && <FalseAlarms certificate={certificate} />}
    </section>
  );
}
