import { useMemo, useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Asset, FaultLine, Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { TraceBuffer } from "../../live/buffer";
import { Choice } from "../../parts/choice";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { VerdictWarnings } from "../../parts/verdict-warnings";
import { JudgeAgain } from "./judge-again";
import { NothingPlayed } from "./nothing-played";
import { Player } from "./player";
import type { ProfileOrRecorded } from "./profile-choice";
import { SessionHeader } from "./session-header";
import { stretchAt, stretches, stretchText } from "./stretches";
import { useAddress } from "./use-address";

/** Largest number of moments of a trace: that of a longer session is thinned out, and the shown part is
 * fetched again with every sample. */
const POINTS = 12_000;

interface Props {
  session: Session;
  asset: Asset;
  faults: FaultLine[];
  refetch: () => Promise<void>;
}

export function SessionDetails({ session, asset, faults, refetch }: Props) {
  /** The profile with which the session is judged for the charts. */
  const { address, write } = useAddress();
  const [profile, setProfile] = useState<ProfileOrRecorded>(address.profile);
  const chooseProfile = (next: ProfileOrRecorded) => {
    setProfile(next);
    write({ profile: next });
  };
  const pieces = useMemo(() => stretches(session), [session]);
  const texts = pieces.map((piece, i) => [i, stretchText(piece, session.first_t_s ?? 0)] as const);
  /** The shown stretch of a long recording: that of the address, or the last one. */
  const [chosen, setChosen] = useState(() => stretchAt(pieces, address.t));
  const shown = Math.min(chosen ?? Infinity, pieces.length - 1);
  const fetchTrace = () =>
    api.trace(session.id, { ...pieces[shown], points: POINTS, profile: profile || undefined });
  const trace = useQuery(fetchTrace, `${session.id} ${profile} ${shown}`);
  const { data } = trace;
  const buffer = useMemo(() => (data ? TraceBuffer.of(data) : undefined), [data]);
  return (
    <main class="asset">
      <SessionHeader session={session} refetch={refetch} />
      <VerdictWarnings verdict={session.verdict} asset={session.asset} />
      <ErrorMessage error={trace.error} retry={trace.refetch} />
      {pieces.length > 1 && (
        <p class="note">
          This recording is long and shown in stretches.{" "}
          <Choice isInline label="Stretch" options={texts} value={shown} change={setChosen} />
        </p>
      )}
      {!buffer && !trace.error && <Loading what="the recording" />}
      {buffer?.t.length === 0 && <NothingPlayed session={session} asset={asset} faults={faults} />}
      <Player
        session={session}
        asset={asset}
        faults={faults}
        buffer={buffer}
        thresholds={data?.thresholds ?? []}
        profile={profile}
        stride={data?.stride ?? 1}
        points={POINTS}
        setProfile={chooseProfile}
      />
      <JudgeAgain session={session} asset={asset} faults={faults} />
    </main>
  );
}
