import type { Asset, State } from "../../api/types";
import type { TraceBuffer } from "../../live/buffer";
import { Facts } from "../../parts/facts";
import type { TraceMoment } from "../../parts/xy-trace/draw-xy-trace";
import { XyTrace } from "../../parts/xy-trace/xy-trace";
import { degrees, millimetres, number } from "../../words/numbers";

/** Fewer moments say nothing of the rate. */
const LEAST_MOMENTS = 20;

interface Props {
  asset: Asset;
  state?: State;
  buffer: TraceBuffer;
  isSending: boolean;
  moment: () => TraceMoment | null;
}

/** What the rig sends now. */
export function LiveCard({ asset, state, buffer, isSending, moment }: Props) {
  const { x, y } = state?.evidence ?? {};
  const n = buffer.t.length;
  const rate = n > LEAST_MOMENTS ? (n - 1) / (buffer.last - buffer.first) : null;
  return (
    <section class="card">
      <h2>Live</h2>
      {!isSending && <p class="note">Nothing comes in right now.</p>}
      <XyTrace asset={asset} moment={moment} />
      <Facts
        facts={[
          ["Command qy, ball x", `${degrees(x?.command_rad)}, ${millimetres(x?.position_m)}`],
          ["Command qx, ball y", `${degrees(y?.command_rad)}, ${millimetres(y?.position_m)}`],
          ["Rate", number(rate, 0, "Hz")],
        ]}
      />
    </section>
  );
}
