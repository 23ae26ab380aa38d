import { alarmApi } from "../../api/alarms";
import { api } from "../../api/client";
import type { LinkStretch, RigLink } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import {
  clockText,
  delayText,
  gapsText,
  rateText,
  spacingText,
  unjudgedText,
  unknownText,
} from "../../words/link";
import { count, NONE, seconds } from "../../words/numbers";
import { dateTime, sinceText, timeOfDay } from "../../words/time";
import { MuteButton } from "./mute-button";

/** Interval between two requests, ms. */
const LINK_MS = 5000;

type Row = [name: string, text: (of: LinkStretch) => string];

const rows = (expected: number): Row[] => [
  ["Samples", (of) => count(of.samples)],
  ["Rate", (of) => rateText(of, expected)],
  ["Spacing", spacingText],
  ["Gaps", gapsText],
  ["Delay", delayText],
  ["Not judged", unjudgedText],
  ["Sent twice", (of) => (of.duplicates ? count(of.duplicates) : "none")],
  ["Out of order", (of) => (of.unordered ? count(of.unordered) : "none")],
];

function LinkTable({ link: { session, recent, expected_rate_hz: expected } }: { link: RigLink }) {
  return (
    <table class="numbers link">
      <thead>
        <tr>
          <th scope="col">
            <span class="hidden">Quantity</span>
          </th>
          <th scope="col">Last 5 minutes</th>
          <th scope="col">This session{session && `, counted since ${sinceText(session.from)}`}</th>
        </tr>
      </thead>
      <tbody>
        {rows(expected).map(([name, text]) => (
          <tr>
            <th scope="row">{name}</th>
            <td>{recent ? text(recent) : NONE}</td>
            <td>{session ? text(session) : NONE}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

/** Whether an alarm tells that data stay away, and by whom it is muted. */
function CommunicationMute({ asset }: { asset: string }) {
  const { data: mutes, refetch } = useQuery(() => alarmApi.mutes(asset), `${asset} mutes`, LINK_MS);
  if (!mutes) return null;
  const mute = mutes.find(({ code }) => code === "communication_lost");
  return (
    <div class="mute-line">
      <span class="quiet">
        {mute
          ? `No alarm if data stop: muted by ${mute.by} until ${dateTime(mute.until)}: ${mute.reason}`
          : "Alarms if data stop during a session."}
      </span>
      <MuteButton asset={asset} code="communication_lost" mute={mute} changed={refetch} />
    </div>
  );
}

/** How the samples of the rig arrive, in its session and in the last minutes. */
export function LinkCard({ asset }: { asset: string }) {
  const fetchLink = () => api.link(asset).then((counted) => ({ link: counted, at: new Date() }));
  const { data } = useQuery(fetchLink, `${asset} link`, LINK_MS);
  const { link, at } = data ?? {};
  const isCounted = link?.session ?? link?.recent;
  return (
    <section class="card" aria-labelledby="link-heading">
      <div class="card-head">
        <h2 id="link-heading">Link</h2>
        {at && <span class="quiet small-text">as of {timeOfDay(at)}</span>}
      </div>
      {link && !isCounted && <p class="quiet">No samples have arrived since the service was started.</p>}
      {link && isCounted && (
        <>
          <LinkTable link={link} />
          {link.unknown.length > 0 && (
            <p class="note">Keys of the telemetry that are not understood: {unknownText(link)}.</p>
          )}
          <p class="quiet small-text">
            Rate and spacing are by the clock of the device, which {clockText(link.clock_offset_s)}. Pauses
            over {seconds(link.gap_s, 1)} are gaps and restart the evaluation. Delay is relative to the
            fastest batch.
          </p>
        </>
      )}
      <CommunicationMute asset={asset} />
    </section>
  );
}
