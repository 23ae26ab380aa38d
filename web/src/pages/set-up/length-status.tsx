import { duration } from "../../words/time";
import { MINUTE_S } from "./chosen-sessions";

/** How long what was chosen is, of the minute that is wanted. */
export function LengthStatus({ seconds }: { seconds: number }) {
  return (
    <p role="status">
      {duration(seconds)} chosen{seconds < MINUTE_S ? "; a minute is better" : ""}.{" "}
      <progress value={Math.min(seconds, MINUTE_S)} max={MINUTE_S} aria-label="Share of a minute" />
    </p>
  );
}
