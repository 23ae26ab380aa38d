import { useState } from "preact/hooks";
import { panned, zoomRange } from "./visible-range";

/** The range that was zoomed to within the recording from `first` to `last`, s. */
export function useZoom(first: number, last: number) {
  const [zoom, setZoom] = useState<[number, number]>();
  return {
    zoom,
    zoomTo: (range: [number, number] | undefined) => setZoom(range && zoomRange(range, first, last)),
    pan: (share: number) => setZoom((range) => range && panned(range, share, first, last)),
  };
}

export type Zoom = ReturnType<typeof useZoom>;
