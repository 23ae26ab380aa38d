import { useState } from "preact/hooks";
import { api } from "../../api/client";
import { ActionButton } from "../../parts/action-button";
import { ActorField, useActor } from "../../parts/actor-field";

interface Props {
  session: string;
  /** The current moment, or the range that was zoomed to, s. */
  place: () => { from_s: number; to_s?: number };
  isZoomed: boolean;
  refetch: () => Promise<unknown>;
}

/** Adds a remark on the current moment, or on the range that was zoomed to. */
export function RemarkForm({ session, place, isZoomed, refetch }: Props) {
  const actor = useActor();
  const [text, setText] = useState("");
  const keep = async () => {
    actor.remember();
    await api.addRemark(session, { text, ...place() });
    setText("");
    await refetch();
  };
  return (
    <div class="note-form">
      <label>
        Remark
        <textarea rows={2} maxLength={2000} value={text} onInput={(e) => setText(e.currentTarget.value)} />
      </label>
      <ActorField actor={actor} />{" "}
      <ActionButton class="small" action={keep} disabled={!text.trim()} needs="operator">
        {isZoomed ? "Add remark on the shown range" : "Add remark at this moment"}
      </ActionButton>
    </div>
  );
}
