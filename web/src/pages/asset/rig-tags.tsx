import { useRef, useState } from "preact/hooks";
import { tagApi, type Tags } from "../../api/tags";
import { useQuery } from "../../hooks/use-query";
import { ActionButton } from "../../parts/action-button";
import { Dialog } from "../../parts/dialog";
import { useRefusal } from "../../parts/login/rights";
import { Link } from "../../router/link";
import { fleetPath } from "../../router/paths";
import { tagsIn } from "../../words/tags";

/** The tags of a rig, each with the way to the rigs that have it. */
export function RigTags({ asset }: { asset: string }) {
  const { data, refetch } = useQuery(() => tagApi.of(asset), `${asset} tags`);
  const [isOpen, setOpen] = useState(false);
  const refused = useRefusal("operator");
  if (!data) return null;
  const { tags } = data;
  return (
    <div class="chips">
      {tags.map((tag) => (
        <Link class="chip" to={fleetPath({ tag })}>
          {tag}
        </Link>
      ))}
      <button
        type="button"
        class="small"
        disabled={refused !== undefined}
        title={refused}
        onClick={() => setOpen(true)}
      >
        {tags.length ? "Change tags" : "Add tags"}
      </button>
      {isOpen && <TagsDialog asset={asset} before={data} changed={refetch} close={() => setOpen(false)} />}
    </div>
  );
}

interface DialogProps {
  asset: string;
  /** The tags when the dialog was opened. */
  before: Tags;
  changed: () => Promise<unknown>;
  close: () => void;
}

function TagsDialog({ asset, before, changed, close }: DialogProps) {
  const [edited] = useState(before);
  const [text, setText] = useState(edited.tags.join(" "));
  const saveButton = useRef<HTMLDivElement>(null);
  const save = async () => {
    await tagApi.put(asset, tagsIn(text), edited);
    await changed();
    close();
  };
  return (
    <Dialog title={`Tags of ${asset}`} close={close}>
      <label>
        Tags, separated by blanks
        <input
          value={text}
          onInput={(e) => setText(e.currentTarget.value)}
          onKeyDown={(e) => e.key === "Enter" && saveButton.current?.querySelector("button")?.click()}
        />
      </label>
      <p class="quiet">At most 20 words of letters, digits, “-”, “_” and “.”, such as a room or a line.</p>
      <div class="form-end" ref={saveButton}>
        <ActionButton class="primary" action={save} needs="operator">
          Save
        </ActionButton>
      </div>
    </Dialog>
  );
}
