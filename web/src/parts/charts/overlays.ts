/** Overlays of a chart: the shading where the gate is open, and marks. */
import type uPlot from "uplot";
import { colour } from "../../theme";
import { textScale } from "./chart-options";

export interface Mark {
  t: number;
  label: string;
  /** The name of a colour of the style sheet. */
  colour: string;
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

/** Draws vertical lines at `marks` with their labels. */
export function drawMarks(plot: uPlot, marks: Mark[]): void {
  const { ctx } = plot;
  const lineHeight = 12 * textScale() * devicePixelRatio;
  ctx.save();
  ctx.font = `${lineHeight * 0.92}px system-ui, sans-serif`;
  // The end of each row of labels: labels that would overlap are put into separate rows.
  const rowEnds: number[] = [];
  for (const mark of marks) {
    const x = Math.round(plot.valToPos(mark.t, "x", true));
    ctx.strokeStyle = ctx.fillStyle = colour(mark.colour);
    drawLine(plot, x, mark.label !== "");
    drawLabel(plot, x, mark.label, lineHeight, rowEnds);
  }
  ctx.restore();
}

function drawLine({ ctx, bbox }: uPlot, x: number, isLabelled: boolean): void {
  ctx.lineWidth = devicePixelRatio * (isLabelled ? 1.5 : 1);
  ctx.setLineDash(isLabelled ? [4 * devicePixelRatio, 3 * devicePixelRatio] : []);
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
}

function drawLabel(
  { ctx, bbox }: uPlot,
  x: number,
  label: string,
  lineHeight: number,
  rowEnds: number[],
): void {
  const width = ctx.measureText(label).width + 6 * devicePixelRatio;
  const fitsRight = x + width < bbox.left + bbox.width;
  const left = fitsRight ? x : x - width;
  const freeRow = rowEnds.findIndex((end) => end <= left);
  const row = freeRow < 0 ? rowEnds.length : freeRow;
  rowEnds[row] = left + width;
  ctx.textAlign = fitsRight ? "left" : "right";
  ctx.fillText(label, x + (fitsRight ? 4 : -4) * devicePixelRatio, bbox.top + (row + 0.9) * lineHeight);
}
