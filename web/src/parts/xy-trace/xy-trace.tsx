import { useRef } from "preact/hooks";
import type { Asset } from "../../api/types";
import { useAnimationFrame } from "../../hooks/use-animation-frame";
import { drawXyTrace, type TraceMoment } from "./draw-xy-trace";

interface Props {
  asset: Asset;
  /** Returns what to draw; called before each frame. */
  moment: () => TraceMoment | null;
}

/** The paths of the ball and of the twin's ball, seen from above. */
export function XyTrace({ asset, moment }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const drawn = useRef("");
  useAnimationFrame(() => {
    const now = moment();
    const element = canvas.current;
    if (!now || !element) return;
    const { theme } = document.documentElement.dataset;
    const key = [now.t.toFixed(3), element.clientWidth, theme, now.buffer.t.length].join(" ");
    if (key === drawn.current) return;
    drawn.current = key;
    drawXyTrace(element, asset, now);
  });
  const label =
    "Path of the ball on the plate, seen from above: x to the right, y up. " +
    "A positive command of the x servo (qy) moves the ball to the right, one of the y servo (qx) down.";
  return <canvas ref={canvas} class="xy" role="img" aria-label={label} />;
}
