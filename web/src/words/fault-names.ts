/** Titles and descriptions of the fault codes and fault kinds of the service. */
import type { Candidate, FaultCode, FaultKind } from "../api/types";

const CODE: Record<FaultCode, { title: string; meaning: string }> = {
  x_servo: { title: "X servo", meaning: "moves the ball along x by turning the plate about y (qy)" },
  y_servo: { title: "Y servo", meaning: "moves the ball along y by turning the plate about x (qx)" },
  stuck_ball: { title: "Stuck ball", meaning: "the ball does not roll although the plate is tilted" },
  sensor: { title: "Position sensor", meaning: "measures the position of the ball" },
};

/** All fault codes. */
export const CODES = Object.keys(CODE) as FaultCode[];

interface KindWords {
  meaning: string;
  /** The meaning for a fault whose test passes again. */
  past: string;
  /** How the demo offers to inject it; `meaning` if it is missing. */
  injected?: string;
}

const KIND: Record<FaultKind, KindWords> = {
  dead: {
    meaning: "does not respond: the plate returns to zero",
    past: "did not respond: the plate returned to zero",
  },
  held: { meaning: "holds its angle whatever the command", past: "held its angle whatever the command" },
  gain: { meaning: "moves too little or too much", past: "moved too little or too much" },
  reversed: { meaning: "moves in the wrong direction", past: "moved in the wrong direction" },
  offset: {
    meaning: "has a constant angle error, as with a slipped horn",
    past: "had a constant angle error, as with a slipped horn",
  },
  slow: { meaning: "follows the command far too slowly", past: "followed the command far too slowly" },
  intermittent: {
    meaning: "fails intermittently, as with a loose contact",
    past: "failed intermittently, as with a loose contact",
  },
  frozen: { meaning: "repeats its last reading", past: "repeated its last reading" },
  dropout: { meaning: "gives no readings", past: "gave no readings" },
  noise: {
    meaning: "is much noisier than at its calibration",
    past: "was much noisier than at its calibration",
    injected: "much noisier readings",
  },
  spikes: {
    meaning: "gives single readings that are far off",
    past: "gave single readings that were far off",
    injected: "single readings that are far off",
  },
  jump: {
    meaning: "gives readings that are shifted by a constant offset",
    past: "gave readings that were shifted by a constant offset",
    injected: "readings shifted by a constant offset",
  },
};

/** Returns a word of the service that this version of the page does not know as plain text. */
const plain = (word: string) => word.replaceAll("_", " ");

const isFaultCode = (code: string): code is FaultCode => Object.hasOwn(CODE, code);

const isFaultKind = (kind: string): kind is FaultKind => Object.hasOwn(KIND, kind);

/** Returns the title of a fault code; an unknown code, as in a mistyped address, as plain text. */
export const codeTitle = (code: string) => (isFaultCode(code) ? CODE[code].title : plain(code));

/** What is wrong if the kind of the fault is not known. */
const FAULT: Record<FaultCode, KindWords> = {
  x_servo: {
    meaning: "the ball does not move along x as commanded",
    past: "the ball did not move along x as commanded",
  },
  y_servo: {
    meaning: "the ball does not move along y as commanded",
    past: "the ball did not move along y as commanded",
  },
  stuck_ball: {
    meaning: CODE.stuck_ball.meaning,
    past: "the ball did not roll although the plate was tilted",
  },
  sensor: { meaning: "the readings are implausible", past: "the readings were implausible" },
};

/** A fault with its kind, and how likely this kind is: its weight, or the candidates with theirs. */
export interface Finding {
  code: FaultCode;
  kind?: FaultKind | null;
  kind_weight?: number | null;
  candidates?: Candidate[];
}

/** Weight from which on a kind is stated as a fact. */
const SURE = 0.8;

/** Returns the weight of a kind that is only probable, in %; undefined for one that is sure, or without a kind. */
function doubt({ kind, kind_weight, candidates }: Finding): number | undefined {
  const weight = kind_weight ?? candidates?.find((each) => each.kind === kind)?.weight ?? 1;
  return kind && weight < SURE ? Math.round(weight * 100) : undefined;
}

/** Returns the kind of a fault: `dead`, or `probably dead, 51 %`. */
export function kindText(fault: Finding, isShort = false): string {
  const percent = doubt(fault);
  if (percent === undefined) return fault.kind ?? "";
  return `probably ${fault.kind}${isShort ? "" : `, ${percent} %`}`;
}

/** Returns what is wrong with the rig, or was if the test of the fault passes again. */
export function faultMeaning(fault: Finding, isOver = false): string {
  const { code, kind } = fault;
  const words = kind ? KIND[kind] : FAULT[code];
  const meaning = words?.[isOver ? "past" : "meaning"] ?? plain(kind ?? code);
  return doubt(fault) === undefined ? meaning : `probably ${meaning}`;
}

export const codeMeaning = (code: FaultCode) => CODE[code]?.meaning ?? "";

export const kindMeaning = (kind?: FaultKind | null) =>
  kind ? (KIND[kind]?.meaning ?? plain(kind)) : "the kind of fault is not known";

/** Describes the fault that the demo injects; `null` if the diagnosis has no such kind. */
export const injectedMeaning = (kind: string) =>
  isFaultKind(kind) ? (KIND[kind].injected ?? KIND[kind].meaning) : null;

/** Returns the title of a fault with its kind, and without the weight of the kind if it `isShort`. */
export const faultTitle = (fault: Finding, isShort = false) =>
  codeTitle(fault.code) + (fault.kind ? ` (${kindText(fault, isShort)})` : "");
