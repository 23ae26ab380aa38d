import { api } from "../../api/client";
import type { Remark } from "../../api/types";
import type { Query } from "../../hooks/use-query";
import { ActionButton } from "../../parts/action-button";
import { ErrorMessage } from "../../parts/error-message";
import { dateTime } from "../../words/time";
import { RemarkForm } from "./remark-form";
import { remarkTime } from "./remarks";
import type { Playback } from "./use-playback";

interface Props {
  /** The id of the session. */
  session: string;
  remarks: Query<Remark[]>;
  playback: Playback;
  zoom?: [number, number];
}

/** The remarks on moments of the session, which are marked in the charts. */
export function RemarksCard({ session, remarks: { data, error, refetch }, playback, zoom }: Props) {
  const { t, seek } = playback;
  const place = () => (zoom ? { from_s: zoom[0], to_s: zoom[1] } : { from_s: t.current });
  const remove = (id: string) => api.removeRemark(session, id).then(refetch);
  return (
    <section class="card">
      <h2>Remarks</h2>
      <ErrorMessage error={error} retry={refetch} />
      {data && data.length > 0 && (
        <ul class="remarks" aria-label="Remarks">
          {data.map((remark) => (
            <li key={remark.id}>
              <button type="button" class="link n" onClick={() => seek(remark.from_s)}>
                {remarkTime(remark)}
              </button>{" "}
              <span class="text">{remark.text}</span>{" "}
              <span class="quiet small-text">
                {remark.by}, {dateTime(remark.at)}
              </span>{" "}
              <ActionButton
                class="small"
                action={() => remove(remark.id)}
                label={`Remove the remark at ${remarkTime(remark)}`}
                needs="operator"
              >
                Remove
              </ActionButton>
            </li>
          ))}
        </ul>
      )}
      <RemarkForm session={session} place={place} isZoomed={zoom !== undefined} refetch={refetch} />
    </section>
  );
}
