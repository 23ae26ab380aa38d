/** Overlays of a chart: the shading where the gate is open, lines that decide, and marks. */
import type uPlot from "uplot";
import type { Axis } from "../../api/types";
import { colour } from "../../theme";
import { textScale, type Threshold } from "./chart-options";
import { placeLineLabels, placeMarkLabels } from "./label-places";

export interface Mark {
  t: number;
  label: string;
  /** The name of a colour of the style sheet. */
  colour: string;
  /** The axis whose charts have the mark; those of both without one. */
  axis?: Axis | null;
  /** Whether it is the current time of the playback, drawn as a thin line. */
  isPlayhead?: boolean;
}

/** Shades the background where the gate is open. */
export function shadeGates(plot: uPlot, times: number[], gates: boolean[]): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.fillStyle = colour("gate");
  let from: number | null = null;
  for (let i = 0; i <= gates.length; i++) {
    const isOpen = gates[i] === true;
    if (isOpen && from === null) from = times[i]!;
    if (!isOpen && from !== null) {
      const left = plot.valToPos(from, "x", true);
      const right = plot.valToPos(times[Math.min(i, times.length - 1)]!, "x", true);
      ctx.fillRect(left, bbox.top, right - left, bbox.height);
      from = null;
    }
  }
  ctx.restore();
}

/** Draws the values that decide as horizontal lines. */
export function drawThresholds(plot: uPlot, thresholds: Threshold[]): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.strokeStyle = colour("limit");
  ctx.lineWidth = devicePixelRatio;
  for (const { value } of thresholds) {
    const y = Math.round(plot.valToPos(value, "y", true));
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
  }
  ctx.restore();
}

/** Draws the labels of the horizontal lines. */
export function drawThresholdLabels(plot: uPlot, thresholds: Threshold[]): void {
  const { ctx, bbox } = plot;
  const height = 13 * textScale() * devicePixelRatio;
  ctx.save();
  ctx.font = `${height * 0.85}px system-ui, sans-serif`;
  const labels = thresholds.map(({ value, label }) => ({
    y: Math.round(plot.valToPos(value, "y", true)),
    width: ctx.measureText(label).width,
  }));
  const right = bbox.left + bbox.width - 4 * devicePixelRatio;
  const places = placeLineLabels(labels, { top: bbox.top, bottom: bbox.top + bbox.height, right }, height);
  places.forEach(({ right, top }, i) => {
    const { width } = labels[i]!;
    drawText(ctx, { text: thresholds[i]!.label, colour: "quiet", left: right - width, top, width, height });
  });
  ctx.restore();
}

/** Draws vertical lines at `marks` with their labels. */
export function drawMarks(plot: uPlot, marks: Mark[]): void {
  const { ctx, bbox } = plot;
  const height = 13 * textScale() * devicePixelRatio;
  ctx.save();
  ctx.font = `${height * 0.85}px system-ui, sans-serif`;
  const position = ({ t }: Mark) => Math.round(plot.valToPos(t, "x", true));
  for (const mark of marks) {
    ctx.strokeStyle = colour(mark.colour);
    drawLine(plot, position(mark), !mark.isPlayhead);
  }
  const labelled = marks.filter(({ label }) => label);
  const margin = 4 * devicePixelRatio;
  const labels = labelled.map((mark) => ({
    x: position(mark),
    width: ctx.measureText(mark.label).width + 2 * margin,
    text: mark.label,
  }));
  const rows = Math.floor(bbox.height / height);
  placeMarkLabels(labels, bbox.left + bbox.width, rows).forEach((place, i) => {
    const { label: text, colour } = labelled[i]!;
    const width = labels[i]!.width - 2 * margin;
    if (!place) return;
    drawText(ctx, {
      text,
      colour,
      left: place.left + margin,
      top: bbox.top + place.row * height,
      width,
      height,
    });
  });
  ctx.restore();
}

function drawLine({ ctx, bbox }: uPlot, x: number, isDashed: boolean): void {
  ctx.lineWidth = devicePixelRatio * (isDashed ? 1.5 : 1);
  ctx.setLineDash(isDashed ? [4 * devicePixelRatio, 3 * devicePixelRatio] : []);
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
}

interface PlacedText {
  text: string;
  /** The name of a colour of the style sheet. */
  colour: string;
  left: number;
  top: number;
  width: number;
  height: number;
}

/** Draws a text on its own ground, so that it can be read above the curves. */
function drawText(ctx: CanvasRenderingContext2D, placed: PlacedText): void {
  const { text, left, top, width, height } = placed;
  ctx.globalAlpha = 0.9;
  ctx.fillStyle = colour("panel");
  ctx.fillRect(left - 2, top, width + 4, height);
  ctx.globalAlpha = 1;
  ctx.fillStyle = colour(placed.colour);
  ctx.textAlign = "left";
  ctx.textBaseline = "middle";
  ctx.fillText(text, left, top + height / 2);
}
