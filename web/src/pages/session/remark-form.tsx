import { useState } from "preact/hooks";
import { actor, rememberActor } from "../../api/access";
import { api } from "../../api/client";
import { ActionButton } from "../../parts/action-button";
import { useCaller } from "../../parts/login/caller";

interface Props {
  session: string;
  /** The current moment, or the range that was zoomed to, s. */
  place: () => { from_s: number; to_s?: number };
  isZoomed: boolean;
  refetch: () => Promise<unknown>;
}

/** Keeps a remark on the current moment, or on the range that was zoomed to. */
export function RemarkForm({ session, place, isZoomed, refetch }: Props) {
  const caller = useCaller();
  const [name, setName] = useState(actor());
  const [text, setText] = useState("");
  const keep = async () => {
    rememberActor(name);
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
      {!caller?.name && (
        <label class="inline">
          as{" "}
          <input
            value={name}
            size={12}
            maxLength={60}
            onInput={(e) => setName(e.currentTarget.value)}
            aria-label="Your name, kept with the remark"
          />
        </label>
      )}{" "}
      <ActionButton class="small" action={keep} disabled={!text.trim()} needs="operator">
        {isZoomed ? "Keep for the shown range" : "Keep for this moment"}
      </ActionButton>
    </div>
  );
}
