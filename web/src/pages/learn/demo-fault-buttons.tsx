import type { Demo } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { codeTitle, kindMeaning } from "../../words/fault-names";
import { faultsByCode } from "./demo-faults";

interface Props {
  demo: Demo;
  breakRig: (fault: string) => Promise<unknown>;
}

/** A button for each fault that the simulated rig can have. */
export function DemoFaultButtons({ demo: { buttons, broken }, breakRig }: Props) {
  return (
    <div class="breakers">
      {[...faultsByCode(buttons)].map(([code, faults]) => (
        <fieldset>
          <legend>{codeTitle(code)}</legend>
          {faults.map(({ id, kind }) => (
            <ActionButton
              class={broken.includes(id) ? "danger" : ""}
              action={() => breakRig(id)}
              label={`Break: ${codeTitle(code)}, ${kind}`}
            >
              <b>{kind}</b>
              <br />
              <span class="quiet small-text">{kindMeaning(kind)}</span>
            </ActionButton>
          ))}
        </fieldset>
      ))}
    </div>
  );
}
