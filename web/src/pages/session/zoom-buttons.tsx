import { seconds } from "../../words/numbers";
import type { Zoom } from "./use-zoom";

/** Part of the shown range by which a button moves it. */
const STEP = 0.5;

/** The range that was zoomed to, with buttons that move it and that end the zoom. */
export function ZoomButtons({ zoom: { zoom, zoomTo, pan } }: { zoom: Zoom }) {
  if (!zoom) return null;
  return (
    <span class="chips" role="group" aria-label="Zoom">
      <button type="button" class="small" aria-label="Earlier" onClick={() => pan(-STEP)}>
        ◀
      </button>
      <span class="n small-text">
        {seconds(zoom[0])} to {seconds(zoom[1])}
      </span>
      <button type="button" class="small" aria-label="Later" onClick={() => pan(STEP)}>
        ▶
      </button>
      <button type="button" class="small" onClick={() => zoomTo(undefined)}>
        Zoom out
      </button>
    </span>
  );
}
