import { duration } from "../../words/time";
import { MINUTE_S } from "./chosen-sessions";

/** The total duration of the chosen sessions, of the recommended minute. */
export function LengthStatus({ seconds }: { seconds: number }) {
  return (
    <p role="status">
      {duration(seconds)} chosen{seconds < MINUTE_S ? "; at least one minute is recommended" : ""}.{" "}
      <progress value={Math.min(seconds, MINUTE_S)} max={MINUTE_S} aria-label="Fraction of a minute" />
    </p>
  );
}
