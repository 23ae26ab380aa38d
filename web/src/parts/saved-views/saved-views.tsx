/** The saved views of a list: open, rename and delete them, and save the present one. */
import { useState } from "preact/hooks";
import { navigate, useLocation } from "../../router/navigation";
import { Dialog } from "../dialog";
import { useSavedViews } from "./use-saved-views";
import { ViewRow } from "./view-row";
import { MAX_VIEW_NAME, renamed, withoutView, withView } from "./views";

/** `page` is the address of the list without its query. */
export function SavedViews({ page }: { page: string }) {
  const [isOpen, setOpen] = useState(false);
  return (
    <>
      <button type="button" onClick={() => setOpen(true)}>
        Views
      </button>
      {isOpen && <ViewsDialog page={page} close={() => setOpen(false)} />}
    </>
  );
}

function ViewsDialog({ page, close }: { page: string; close: () => void }) {
  const [views, keep] = useSavedViews(page);
  const { query } = useLocation();
  const [name, setName] = useState("");
  const open = (chosen: string) => {
    navigate(chosen ? `${page}?${chosen}` : page);
    close();
  };
  const save = (event: Event) => {
    event.preventDefault();
    keep(withView(views, name, query.toString()));
    setName("");
  };
  return (
    <Dialog title="Saved views" close={close}>
      {views.length === 0 && <p class="quiet">None yet. A view is the present filter under a name.</p>}
      <ul class="views">
        {views.map((view) => (
          <ViewRow
            key={view.name}
            view={view}
            open={() => open(view.query)}
            rename={(to) => keep(renamed(views, view.name, to))}
            remove={() => keep(withoutView(views, view.name))}
          />
        ))}
      </ul>
      <form class="form-row" onSubmit={save}>
        <label>
          Name of the present view
          <input value={name} maxLength={MAX_VIEW_NAME} onInput={(e) => setName(e.currentTarget.value)} />
        </label>
        <button type="submit" class="primary" disabled={!name.trim()}>
          Save
        </button>
      </form>
      <p class="quiet small-text">Views are saved in this browser. Their addresses can be sent to others.</p>
    </Dialog>
  );
}
