import { useState } from "preact/hooks";
import { MAX_VIEW_NAME, type SavedView } from "./views";

interface Props {
  view: SavedView;
  open: () => void;
  rename: (to: string) => void;
  remove: () => void;
}

/** One saved view. */
export function ViewRow({ view, open, rename, remove }: Props) {
  const [draft, setDraft] = useState<string>();
  const submit = (event: Event) => {
    event.preventDefault();
    rename(draft ?? "");
    setDraft(undefined);
  };
  if (draft !== undefined)
    return (
      <li>
        <form class="form-row" onSubmit={submit}>
          <input
            aria-label={`New name of ${view.name}`}
            value={draft}
            maxLength={MAX_VIEW_NAME}
            onInput={(e) => setDraft(e.currentTarget.value)}
          />
          <button type="submit" class="small">
            Rename
          </button>
        </form>
      </li>
    );
  return (
    <li>
      <button type="button" class="link" onClick={open}>
        {view.name}
      </button>{" "}
      <button
        type="button"
        class="small"
        aria-label={`Rename ${view.name}`}
        onClick={() => setDraft(view.name)}
      >
        Rename
      </button>{" "}
      <button type="button" class="small" aria-label={`Delete ${view.name}`} onClick={remove}>
        Delete
      </button>
    </li>
  );
}
