import { useState } from "preact/hooks";
import { actor, rememberActor } from "../api/access";
import { useCaller } from "./login/caller";

interface Actor {
  name: string;
  setName: (name: string) => void;
  /** Keeps the name for this action and later ones. */
  remember: () => void;
}

/** The name that is recorded with an action of the user. */
export function useActor(): Actor {
  const [name, setName] = useState(actor);
  return { name, setName, remember: () => rememberActor(name) };
}

/** The field for the name of the user; not shown if a token identifies the user. */
export function ActorField({ actor: { name, setName } }: { actor: Actor }) {
  const caller = useCaller();
  if (caller?.name) return null;
  return (
    <label class="inline">
      as{" "}
      <input
        value={name}
        size={12}
        maxLength={60}
        onInput={(e) => setName(e.currentTarget.value)}
        aria-label="Your name, recorded with the action"
      />
    </label>
  );
}
