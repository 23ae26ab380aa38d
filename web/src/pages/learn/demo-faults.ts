/** The faults that the demo injects: `code:effect`, as on the command line of `offbd simulate`. */

import { codeTitle, injectedMeaning } from "../../words/fault-names";

export interface DemoFault {
  /** The identifier in the requests to the service. */
  id: string;
  code: string;
  /** The simulated effect. It is not the `FaultKind` of the diagnosis: `hold` is diagnosed as `held`. */
  effect: string;
}

/** The effects that the diagnosis has no kind for. */
const EFFECT: Partial<Record<string, string>> = {
  glued: "fixed to the plate",
  sticky: "moves only at a large tilt",
};

/** The word of the diagnosis for an effect: one word for one thing on the page. */
const WORD: Partial<Record<string, string>> = { hold: "held", freeze: "frozen" };

export const effectWord = (effect: string) => WORD[effect] ?? effect;

/** Describes an injected effect; an unknown one is returned as it is. */
export const effectMeaning = (effect: string) =>
  EFFECT[effect] ?? injectedMeaning(effectWord(effect)) ?? effect;

const parse = (id: string): DemoFault => {
  const [code = "", effect = ""] = id.split(":");
  return { id, code, effect };
};

/** Groups the faults by code, in the order of the service. */
export function faultsByCode(ids: string[]): Map<string, DemoFault[]> {
  const groups = new Map<string, DemoFault[]>();
  for (const fault of ids.map(parse)) groups.set(fault.code, [...(groups.get(fault.code) ?? []), fault]);
  return groups;
}

/** Returns the faults as text: X servo (dead), Position sensor (noise). */
export const faultList = (ids: string[]) =>
  ids
    .map(parse)
    .map(({ code, effect }) => `${codeTitle(code)} (${effectWord(effect)})`)
    .join(", ");
