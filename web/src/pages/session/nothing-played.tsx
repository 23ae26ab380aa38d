import type { Asset, FaultLine, Session } from "../../api/types";
import { plural } from "../../words/numbers";
import { FoundCard } from "./found-card";

interface Props {
  session: Session;
  asset: Asset;
  faults: FaultLine[];
}

/** A session of which no moment was judged: how much was recorded, and the verdict. */
export function NothingPlayed({ session, asset, faults }: Props) {
  const { samples } = session;
  return (
    <>
      <p class="note">
        {samples === 0
          ? "Nothing has been recorded in this session."
          : `${plural(samples, "sample")} ${samples === 1 ? "is" : "are"} recorded, but no moment could be judged, ` +
            "so there is nothing to play back."}
      </p>
      <FoundCard session={session} asset={asset} faults={faults} />
    </>
  );
}
