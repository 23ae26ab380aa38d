/** The remarks on a session. */
import type { Remark } from "../../api/types";
import type { Mark } from "../../parts/charts/overlays";
import { seconds } from "../../words/numbers";

/** Longest label of a mark, characters. */
const LABEL = 24;

const label = (text: string) => {
  const line = text.split("\n", 1)[0]!;
  return line.length > LABEL ? `${line.slice(0, LABEL - 1)}…` : line;
};

/** The marks of remarks: one for a moment, both ends of a stretch. */
export const remarkMarks = (remarks: Remark[]): Mark[] =>
  remarks.flatMap(({ text, from_s, to_s }) => {
    const start: Mark = { t: from_s, label: label(text), colour: "command" };
    return to_s > from_s ? [start, { ...start, t: to_s, label: "" }] : [start];
  });

/** The moment or stretch of a remark in words. */
export const remarkTime = ({ from_s, to_s }: Pick<Remark, "from_s" | "to_s">) =>
  to_s > from_s ? `${seconds(from_s)} to ${seconds(to_s)}` : seconds(from_s);
