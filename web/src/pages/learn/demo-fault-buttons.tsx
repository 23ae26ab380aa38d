import type { Demo } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { codeTitle } from "../../words/fault-names";
import { effectMeaning, effectWord, faultsByCode } from "./demo-faults";

interface Props {
  demo: Demo;
  inject: (fault: string) => Promise<unknown>;
}

/** A button for each fault that can be injected. */
export function DemoFaultButtons({ demo: { buttons, broken }, inject }: Props) {
  return (
    <div class="breakers">
      {[...faultsByCode(buttons)].map(([code, faults]) => (
        <fieldset>
          <legend>{codeTitle(code)}</legend>
          {faults.map(({ id, effect }) => (
            <ActionButton
              class={broken.includes(id) ? "danger" : ""}
              action={() => inject(id)}
              needs="operator"
            >
              <span class="hidden">Inject: {codeTitle(code)}, </span>
              <b>{effectWord(effect)}</b>
              <br />
              <span class="quiet small-text">{effectMeaning(effect)}</span>
            </ActionButton>
          ))}
        </fieldset>
      ))}
    </div>
  );
}
