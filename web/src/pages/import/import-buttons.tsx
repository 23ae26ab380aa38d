import { ActionButton } from "../../parts/action-button";
import { count } from "../../words/numbers";
import type { Mapping } from "./mapping";
import { QUANTITIES, QUANTITY_TITLES, type Quantity } from "./quantities";

/** The required quantities; a recording without commands can be imported. */
const REQUIRED: Quantity[] = ["t_s", "x_m", "y_m"];

interface Props {
  mapping: Mapping;
  nRows: number;
  hasAsset: boolean;
  send: () => Promise<void>;
  cancel: () => void;
}

export function ImportButtons({ mapping, nRows, hasAsset, send, cancel }: Props) {
  const missing = QUANTITIES.filter((quantity) => mapping[quantity].index === null);
  const isReady = hasAsset && !REQUIRED.some((quantity) => missing.includes(quantity));
  return (
    <div class="form-end">
      {missing.length > 0 && (
        <span class="quiet">
          Not assigned: {missing.map((quantity) => QUANTITY_TITLES[quantity]).join(", ")}
        </span>
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
