import { NONE } from "../../words/numbers";

/** Letters that are shown: enough to tell two apart. */
const SHOWN = 12;

/** The beginning of a verdict's hash. */
export const Hash = ({ hash, title }: { hash?: string | null; title?: string }) => (
  <code title={title}>{hash?.slice(0, SHOWN) ?? NONE}</code>
);
