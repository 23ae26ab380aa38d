import { NONE } from "../../words/numbers";

/** Number of displayed characters, enough to distinguish two hashes. */
const SHOWN = 12;

/** The beginning of a verdict's hash. */
export const Hash = ({ hash, title }: { hash?: string | null; title?: string }) => (
  <code title={title}>{hash?.slice(0, SHOWN) ?? NONE}</code>
);
