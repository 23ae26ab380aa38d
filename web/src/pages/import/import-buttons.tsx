import { ActionButton } from "../../parts/action-button";
import { count } from "../../words/numbers";
import type { Mapping } from "./mapping";
import { ROLE_WORDS, ROLES, type Role } from "./roles";

/** Without these there is nothing to judge; a recording without commands is still one. */
const NEEDED: Role[] = ["t_s", "x_m", "y_m"];

interface Props {
  mapping: Mapping;
  nRows: number;
  hasAsset: boolean;
  send: () => Promise<void>;
  cancel: () => void;
}

export function ImportButtons({ mapping, nRows, hasAsset, send, cancel }: Props) {
  const missing = ROLES.filter((role) => mapping[role].index === null);
  const isReady = hasAsset && !NEEDED.some((role) => missing.includes(role));
  return (
    <div class="form-end">
      {missing.length > 0 && (
        <span class="quiet">Still to choose: {missing.map((role) => ROLE_WORDS[role]).join(", ")}</span>
      )}
      <button type="button" onClick={cancel}>
        Cancel
      </button>
      <ActionButton class="primary" action={send} disabled={!isReady}>
        Import {count(nRows)} rows
      </ActionButton>
    </div>
  );
}
