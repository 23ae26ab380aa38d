/** Where the labels of a chart are placed, so that none covers another. */

/** A label at the pixel `x` of its mark. */
export interface MarkLabel {
  x: number;
  width: number;
  text: string;
}

export interface MarkPlace {
  /** Left end of the label, px. */
  left: number;
  row: number;
}

/**
 * Puts the labels of marks into rows below each other, to the right of their marks, or to the left where they
 * would end beyond `right`. A label has no place if all rows are taken, or if the same text is already there.
 */
export function placeMarkLabels(labels: MarkLabel[], right: number, rows: number): (MarkPlace | undefined)[] {
  const placed: (MarkPlace & MarkLabel)[] = [];
  return labels.map((label) => {
    const left = label.x + label.width < right ? label.x : label.x - label.width;
    const near = placed.filter((other) => left < other.left + other.width && other.left < left + label.width);
    if (near.some(({ text }) => text === label.text)) return undefined;
    const row = [...Array(rows).keys()].find((row) => near.every((other) => other.row !== row));
    if (row === undefined) return undefined;
    placed.push({ ...label, left, row });
    return { left, row };
  });
}

/** A label of a horizontal line at the pixel `y`; pixels are counted from the top. */
export interface LineLabel {
  y: number;
  width: number;
}

export interface LinePlace {
  /** Right end of the label, px. */
  right: number;
  /** Upper end of the label, px. */
  top: number;
}

/** Distance between labels beside each other, px. */
const GAP = 8;

/**
 * Puts the labels of horizontal lines at the right end of a chart: that of the uppermost line above it, the
 * others below theirs, or on the other side if there is no room, and beside a label that is already there.
 */
export function placeLineLabels(
  labels: LineLabel[],
  box: { top: number; bottom: number; right: number },
  height: number,
): LinePlace[] {
  const uppermost = Math.min(...labels.map(({ y }) => y));
  const placed: (LinePlace & LineLabel)[] = [];
  return labels.map((label) => {
    const [above, below] = [label.y - height, label.y + 1];
    const isAbove = label.y === uppermost ? above >= box.top : below + height > box.bottom;
    const top = isAbove ? above : below;
    const beside = placed.filter((other) => top < other.top + height && other.top < top + height);
    const right = Math.min(box.right, ...beside.map((other) => other.right - other.width - GAP));
    placed.push({ ...label, right, top });
    return { right, top };
  });
}
