import { useRef } from "preact/hooks";
import type { Asset, State } from "../../api/types";
import { SampleRate } from "../../live/sample-rate";
import { Facts } from "../../parts/facts";
import type { TraceMoment } from "../../parts/xy-trace/draw-xy-trace";
import { XyTrace } from "../../parts/xy-trace/xy-trace";
import { degrees, millimetres, number } from "../../words/numbers";
import { AFTER_THE_END } from "../../words/session";

interface Props {
  asset: Asset;
  state?: State;
  isSending: boolean;
  /** Whether this page has ended the session of the device. */
  hasEnded: boolean;
  moment: () => TraceMoment | null;
}

/** The latest samples of the rig. */
export function LiveCard({ asset, state, isSending, hasEnded, moment }: Props) {
  const { x, y } = state?.evidence ?? {};
  const rate = useRef(new SampleRate()).current;
  if (state) rate.take(state);
  return (
    <section class="card">
      <h2>Live</h2>
      {!isSending && (
        <p class="note">
          No samples are arriving.{hasEnded && ` The session was ended here. ${AFTER_THE_END}`}
        </p>
      )}
      <XyTrace asset={asset} moment={moment} />
      <Facts
        facts={[
          ["Command qy, ball x", `${degrees(x?.command_rad)}, ${millimetres(x?.position_m)}`],
          ["Command qx, ball y", `${degrees(y?.command_rad)}, ${millimetres(y?.position_m)}`],
          ["Rate", number(rate.hz, 0, "Hz")],
        ]}
      />
    </section>
  );
}
