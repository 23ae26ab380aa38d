/** The ball's way over the plate from above, with the twin's beside it. */
import { useRef } from "preact/hooks";
import type { Asset } from "../api/types";
import { useFrames } from "../hooks";
import type { TraceBuffer } from "../live/buffer";
import { colour } from "../theme";

interface Props {
  asset: Asset;
  /** What to draw now: the buffer, up to which moment, and how long a tail, s. */
  moment: () => { buffer: TraceBuffer; t: number; tail: number } | null;
}

export function XyTrace({ asset, moment }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const drawn = useRef("");
  useFrames(() => {
    const now = moment();
    const element = canvas.current;
    if (!now || !element) return;
    const key = `${now.t.toFixed(3)} ${element.clientWidth} ${document.documentElement.dataset.theme} ${now.buffer.t.length}`;
    if (key === drawn.current) return;
    drawn.current = key;
    draw(element, asset, now.buffer, now.t, now.tail);
  });
  return (
    <canvas
      ref={canvas}
      class="xy"
      role="img"
      aria-label="The ball's way over the plate seen from above, x to the right, y up"
    />
  );
}

function draw(canvas: HTMLCanvasElement, asset: Asset, buffer: TraceBuffer, t: number, tail: number): void {
  const { clientWidth: width, clientHeight: height } = canvas;
  const ratio = devicePixelRatio;
  if (canvas.width !== width * ratio || canvas.height !== height * ratio)
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
  const context = canvas.getContext("2d")!;
  const diameter = asset.plate?.diameter_m;
  const [length, depth] = diameter
    ? [diameter, diameter]
    : [asset.plate?.length_m ?? 0.38, asset.plate?.width_m ?? 0.24];
  const scale = Math.min((width - 24) / length, (height - 24) / depth);
  const place = (x: number, y: number): [number, number] => [width / 2 + x * scale, height / 2 - y * scale];
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  outline(context, place, length, depth, Boolean(diameter), scale);
  // The twin knows no rim; what lies beyond the plate is left out.
  context.save();
  context.beginPath();
  context.rect(...place(-length / 2, depth / 2), length * scale, depth * scale);
  context.clip();
  path(context, place, buffer, t, tail, "twinPosition", "twin", [5, 3]);
  path(context, place, buffer, t, tail, "position", "measured", []);
  for (const [key, name] of [
    ["twinPosition", "twin"],
    ["position", "measured"],
  ] as const) {
    const x = buffer.at("x", key, t),
      y = buffer.at("y", key, t);
    if (x === null || y === null) continue;
    context.beginPath();
    context.arc(...place(x, y), Math.max((asset.ball?.radius_m ?? 0.0127) * scale, 4), 0, 2 * Math.PI);
    context.globalAlpha = key === "position" ? 1 : 0.45;
    context.fillStyle = colour(name);
    context.fill();
    context.globalAlpha = 1;
  }
  context.restore();
}

function outline(
  context: CanvasRenderingContext2D,
  place: (x: number, y: number) => [number, number],
  length: number,
  depth: number,
  round: boolean,
  scale: number,
): void {
  context.strokeStyle = colour("edge");
  context.fillStyle = colour("plate");
  context.lineWidth = 1.5;
  context.setLineDash([]);
  context.beginPath();
  if (round) context.arc(...place(0, 0), (length / 2) * scale, 0, 2 * Math.PI);
  else context.rect(...place(-length / 2, depth / 2), length * scale, depth * scale);
  context.fill();
  context.stroke();
  context.lineWidth = 1;
  context.strokeStyle = colour("grid");
  context.beginPath();
  context.moveTo(...place(-length / 2, 0));
  context.lineTo(...place(length / 2, 0));
  context.moveTo(...place(0, -depth / 2));
  context.lineTo(...place(0, depth / 2));
  context.stroke();
  context.fillStyle = colour("quiet");
  context.font = "12px system-ui, sans-serif";
  const [right, middle] = place(length / 2, 0);
  context.fillText("x", right - 12, middle - 5);
  const [centre, top] = place(0, depth / 2);
  context.fillText("y", centre + 5, top + 13);
}

function path(
  context: CanvasRenderingContext2D,
  place: (x: number, y: number) => [number, number],
  buffer: TraceBuffer,
  t: number,
  tail: number,
  key: "position" | "twinPosition",
  name: string,
  dash: number[],
): void {
  context.strokeStyle = colour(name);
  context.lineWidth = 1.5;
  context.setLineDash(dash);
  context.beginPath();
  let isDown = false;
  for (let i = buffer.index(t - tail); i <= buffer.index(t); i++) {
    const x = buffer.x[key][i],
      y = buffer.y[key][i];
    if (x == null || y == null) {
      isDown = false;
      continue;
    }
    if (isDown) context.lineTo(...place(x, y));
    else context.moveTo(...place(x, y));
    isDown = true;
  }
  context.stroke();
}
