import type { SignVerdict } from "../../live/correlation";
import type { Signs } from "../../live/signs";
import { number } from "../../words/numbers";

const VERDICTS: Record<SignVerdict, { text: string; look: string }> = {
  agrees: { text: "moves as commanded", look: "good" },
  reversed: { text: "moves in the wrong direction", look: "warn" },
  swapped: { text: "follows the other command", look: "warn" },
  unclear: { text: "not clear yet", look: "" },
};

/** The result of the sign check for each axis. */
export function SignList({ signs }: { signs: Signs }) {
  return (
    <div role="status">
      <ul class="sanity">
        {(["x", "y"] as const).map((axis) => {
          const { own, other } = signs[axis];
          const { text, look } = VERDICTS[signs.verdict[axis]];
          return (
            <li class={look}>
              {axis}: {text}{" "}
              <span class="quiet">
                (correlation with its own command {number(own, 2)}, with the other {number(other, 2)})
              </span>
            </li>
          );
        })}
      </ul>
    </div>
  );
}
