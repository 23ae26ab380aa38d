/** Overlays of a chart: the shading where the gate is open, and marks. */
import type uPlot from "uplot";
import type { Axis } from "../../api/types";
import { colour } from "../../theme";
import { textScale, type Threshold } from "./chart-options";

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

/** Draws the values that decide as horizontal lines with their labels. */
export function drawThresholds(plot: uPlot, thresholds: Threshold[]): void {
  const { ctx, bbox } = plot;
  const textHeight = 11 * textScale() * devicePixelRatio;
  ctx.save();
  ctx.font = `${textHeight}px system-ui, sans-serif`;
  ctx.textAlign = "right";
  ctx.fillStyle = colour("quiet");
  ctx.strokeStyle = colour("limit");
  ctx.lineWidth = devicePixelRatio;
  for (const { value, label } of thresholds) {
    const y = Math.round(plot.valToPos(value, "y", true));
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    // The label is inside of the line, above one below zero and below one above it.
    ctx.fillText(label, bbox.left + bbox.width - 4 * devicePixelRatio, value > 0 ? y + textHeight : y - 3);
  }
  ctx.restore();
}

/** Draws vertical lines at `marks` with their labels. */
export function drawMarks(plot: uPlot, marks: Mark[]): void {
  const { ctx } = plot;
  const lineHeight = 12 * textScale() * devicePixelRatio;
  ctx.save();
  ctx.font = `${lineHeight * 0.92}px system-ui, sans-serif`;
  // The end of each row of labels: labels that would overlap are put into separate rows.
  const rowEnds: number[] = [];
  const position = ({ t }: Mark) => Math.round(plot.valToPos(t, "x", true));
  for (const mark of marks) {
    ctx.strokeStyle = colour(mark.colour);
    drawLine(plot, position(mark), !mark.isPlayhead);
  }
  for (const mark of marks) if (mark.label) drawLabel(plot, position(mark), mark, lineHeight, rowEnds);
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

function drawLabel(
  { ctx, bbox }: uPlot,
  x: number,
  { label, colour: name }: Mark,
  lineHeight: number,
  rowEnds: number[],
): void {
  const width = ctx.measureText(label).width + 6 * devicePixelRatio;
  const fitsRight = x + width < bbox.left + bbox.width;
  const left = fitsRight ? x : x - width;
  const freeRow = rowEnds.findIndex((end) => end <= left);
  const row = freeRow < 0 ? rowEnds.length : freeRow;
  rowEnds[row] = left + width;
  // A ground behind the text, so that it can be read above the curves.
  ctx.globalAlpha = 0.85;
  ctx.fillStyle = colour("panel");
  ctx.fillRect(left + devicePixelRatio, bbox.top + (row + 0.1) * lineHeight, width, lineHeight);
  ctx.globalAlpha = 1;
  ctx.fillStyle = colour(name);
  ctx.textAlign = fitsRight ? "left" : "right";
  ctx.fillText(label, x + (fitsRight ? 4 : -4) * devicePixelRatio, bbox.top + (row + 0.9) * lineHeight);
}
